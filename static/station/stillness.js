/** Whether the hand lies still, and if not, what moves: shown while that matters. */
import { h, icon, whenChanged } from "../dom.js";
import { partWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const SHOWN = ["connect", "check", "pose_ready", "pose_hold", "step_ready"];

export function mount(root, api, { station }) {
  const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
  const words = h("span", { role: "status" });
  root.append(lamp, words);
  const draw = whenChanged(
    ({ wizard, glove }) => {
      const fastest = wizard.still ? "" : wizard.fastest_segment;
      return [SHOWN.includes(wizard.state), glove.flowing, wizard.still, fastest, wizard.state];
    },
    ([shown, flowing, still, fastest, state]) => {
      const connecting = ["connect", "check"].includes(state); // movement is wanted there, and nowhere else
      root.hidden = !shown || !flowing;
      root.className = `stillness ${still === connecting ? (connecting ? "idle" : "unwanted") : "wanted"}`;
      lamp.replaceChildren(...(still && !connecting ? [icon("check")] : []));
      words.textContent = still ? t(connecting ? "still.idle" : "still.yes") : t("still.no", { part: partWords(fastest || "hand") });
    },
  );
  return station.on("full", draw);
}
