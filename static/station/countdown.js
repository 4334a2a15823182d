/** Seconds in very large digits over the scene: of rest between two trials, until the task starts, and until it is over. */
import { h, whenChanged } from "../dom.js";
import { t } from "../words/words.js";

const WORD = {
  task_ready: "countdown.rest",
  countdown: "countdown.starts",
  resume_countdown: "countdown.resumes",
  task_run: "countdown.left",
  step_countdown: "countdown.starts",
  step_run: "countdown.left",
};

export function mount(root, api, { station }) {
  const digits = h("span", { class: "digits" });
  const word = h("span", {});
  root.append(word, digits);
  root.setAttribute("aria-hidden", "true"); // the wizard's words are read out; a number a second would talk over them
  const draw = whenChanged(
    ({ wizard }) => [WORD[wizard.state], wizard.remaining === null ? null : Math.ceil(wizard.remaining), wizard.state],
    ([words, seconds, state]) => {
      root.hidden = !words || seconds === null;
      if (root.hidden) return;
      word.textContent = t(words);
      digits.textContent = String(seconds);
      root.classList.toggle("soon", state.endsWith("countdown"));
    },
  );
  return station.on("full", draw);
}
