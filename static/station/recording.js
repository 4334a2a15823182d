/** That the recording runs, and since when. */
import { h, lasting, whenChanged } from "../dom.js";
import { clock, t } from "../words/words.js";

const QUIET = 2000; // ms without data

export function mount(root, api, { station }) {
  const dot = h("span", { class: "dot", "aria-hidden": "true" });
  const words = h("span", { class: "kind" });
  const since = h("span", {});
  root.append(dot, words, since);
  const quiet = lasting(QUIET);
  const draw = whenChanged(
    ({ glove }) => [glove.state === "opened" && glove.recorded > 0 && !quiet(!glove.flowing), clock(glove.recorded), glove.recorded > 0],
    ([runs, recorded, some]) => {
      root.classList.toggle("runs", runs);
      words.textContent = t(runs ? "recording.runs" : some ? "recording.paused" : "recording.waits");
      since.textContent = some || runs ? recorded : "";
    },
  );
  return station.on("full", draw);
}
