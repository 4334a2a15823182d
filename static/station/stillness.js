/** Whether the hand lies still, and in the pose whether it lies as it should: shown while that matters. */
import { h, icon, whenChanged } from "../dom.js";
import { partWords } from "../words/clinical.js";
import { t } from "../words/words.js";
import { offWords } from "./pose_fit.js";

const SHOWN = ["connect", "check", "pose_ready", "pose_hold", "step_ready"];

export function mount(root, api, { station }) {
  const lamp = h("span", { class: "lamp", "aria-hidden": "true" });
  const words = h("span", { role: "status" });
  root.append(lamp, words);
  const draw = whenChanged(
    ({ wizard, glove, pose_fit }) => {
      const fastest = wizard.still ? "" : wizard.fastest_segment;
      const off = pose_fit.filter((fit) => fit.grade !== "good").sort((a, b) => b.deg - a.deg)[0];
      return [SHOWN.includes(wizard.state), glove.flowing, wizard.still, fastest, wizard.state, off ?? null, pose_fit.length > 0];
    },
    ([shown, flowing, still, fastest, state, off, judged]) => {
      const connecting = ["connect", "check"].includes(state); // movement is wanted there, and nowhere else
      root.hidden = !shown || !flowing;
      const wanted = connecting ? !still : still && !off;
      root.className = `stillness ${wanted ? "wanted" : connecting ? "idle" : "unwanted"}`;
      lamp.replaceChildren(...(wanted && !connecting ? [icon("check")] : []));
      words.textContent = still ? stillWords(connecting, off, judged) : t("still.no", { part: partWords(fastest || "hand") });
    },
  );
  return station.on("full", draw);
}

function stillWords(connecting, off, judged) {
  if (connecting) return t("still.idle");
  if (off) return t("still.off", { part: partWords(off.part), off: offWords(off) });
  return t(judged ? "still.fits" : "still.yes");
}
