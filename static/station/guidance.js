/** What to do now: one title, one sentence, what went wrong before, and how far it is. */
import { h, whenChanged } from "../dom.js";
import { progressBar } from "../progress_bar.js";
import { inWords, segmentWords } from "../words/clinical.js";
import { counted, t } from "../words/words.js";

export function mount(root, api, { station }) {
  const heading = h("h2", {});
  const sentence = h("p", { class: "sentence" });
  const message = h("div", { role: "alert" });
  const words = h("div", { "aria-live": "polite", "aria-atomic": "true" }, heading, sentence);
  const more = h("div", { class: "soft small" });
  const bar = progressBar(t("wizard.progress"));
  root.append(words, more, message, bar.element);

  const drawWords = whenChanged(
    ({ wizard }) => [wizard.title, wizard.instruction],
    ([title, instruction]) => {
      heading.textContent = title;
      sentence.textContent = instruction;
    },
  );
  const drawMessage = whenChanged(
    ({ wizard, calibration }) => [wizard.message, wizard.proposal, wizard.state, calibration?.source === "none"],
    ([text, proposal, state, guessed]) =>
      message.replaceChildren(
        ...[
          text && h("p", { class: "error" }, inWords(text)),
          proposal && h("p", { class: "warning" }, t(`proposal.${state}.${proposal}`)),
          guessed && h("p", { class: "warning" }, t("wizard.uncalibrated")),
        ].filter(Boolean),
      ),
  );
  const drawMore = whenChanged(
    ({ wizard, calibration, step_quality, stiff_joints: { asked } }) => [
      wizard.state,
      calibration,
      { ...wizard.pace, elapsed: 0 },
      step_quality,
      asked,
    ],
    (values) => more.replaceChildren(...detail(...values)),
  );
  const drawBar = ({ wizard }) => {
    const runs = wizard.state === "pose_hold" || (["task_run", "step_run", "free_run"].includes(wizard.state) && wizard.remaining !== null);
    bar.element.hidden = !runs;
    if (runs) bar.set(wizard.progress);
  };
  const leave = [drawWords, drawMessage, drawMore, drawBar].map((draw) => station.on("full", draw));
  return () => leave.forEach((stop) => stop());
}

/** What helps to decide in this state. */
function detail(state, calibration, pace, quality, asked) {
  if (state === "connect") return [h("p", {}, t("wizard.connect"))];
  if (pace.trials > 1) return [h("p", {}, t("wizard.trial", pace))];
  if (state === "step_review") return quality ? [h("p", {}, qualityWords(quality))] : [];
  if (state !== "pose_review" || !calibration?.least_still) return [];
  const values = {
    still: calibration.stillness_deg_s,
    turned: calibration.misalignment_deg,
    part: segmentWords(calibration.most_misaligned),
  };
  const words = [t("wizard.calibration", values), calibration.steps && counted("wizard.calibration.steps", calibration.steps)];
  const how = asked ? [] : [h("p", {}, words.filter(Boolean).join(" "))]; // a joint that was bent looks like a sensor that sits turned
  return [...how, ...calibration.warnings.map((text) => h("p", { class: "warning" }, inWords(text)))];
}

/** How well a step of the calibration was done. */
function qualityWords(quality) {
  if ("rate_wander" in quality) return t("quality.still", quality);
  if ("spread" in quality) return t("quality.eight", quality);
  return "extent" in quality ? counted("quality.flexion", quality.repetitions, quality) : "";
}
