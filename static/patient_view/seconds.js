/** Seconds in very large digits: until the task starts, until it is over, of rest before the next trial; and how far it is. */
import { h, whenChanged } from "../dom.js";
import { progressBar } from "../progress_bar.js";
import { t } from "../words/words.js";

const WORD = { count: "countdown.starts", run: "countdown.left", watch: "countdown.rest" };

export function mount(root, api, { screen }) {
  const word = h("span", {});
  const digits = h("span", { class: "digits" });
  const trial = h("p", { class: "trial" });
  const bar = progressBar(t("screen.progress"));
  const shown = h("div", { class: "countdown", "aria-hidden": "true" }, word, digits); // a number a second would talk over the words
  root.append(shown, bar.element, trial);
  const draw = whenChanged(
    ({ stage, remaining }) => [stage, remaining === null ? null : Math.ceil(remaining)],
    ([stage, left]) => {
      shown.hidden = !WORD[stage] || left === null;
      if (shown.hidden) return;
      word.textContent = t(WORD[stage]);
      digits.textContent = String(left);
    },
  );
  const drawTrial = whenChanged(
    ({ pace }) => pace && pace.trials > 1 && [pace.trial, pace.trials],
    (trials) => (trial.textContent = trials ? t("wizard.trial", { trial: trials[0], trials: trials[1] }) : ""),
  );
  const drawBar = ({ stage, progress, remaining }) => {
    bar.element.hidden = !(stage === "hold" || (stage === "run" && remaining !== null));
    if (!bar.element.hidden) bar.set(progress);
  };
  const leave = [draw, drawTrial, drawBar].map((one) => screen.on("state", one));
  return () => leave.forEach((stop) => stop());
}
