/** Every trial that was done: what counts in the figures, what does not and why, and how to change that. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { clock, dayAndTime, decimal, t } from "../words/words.js";
import * as correcting from "./correcting.js";

export function mount(root, api, { session, result, recomputed }) {
  const box = errorBox();
  const list = h("ol", { class: "trials" });
  let open = () => {};
  let gone = false;
  root.append(h("h2", {}, t("trials.title")), h("p", { class: "soft" }, t("trials.lead")), list, box.element);
  api.titles().then(
    (titles) => gone || draw(titles),
    () => gone || draw(new Map()),
  );

  function draw(titles) {
    const file = session.recordings.find((recording) => recording.id === result.recording);
    const rows = trialsOf(file, titles).map((trial) => row(file, trial));
    list.replaceChildren(...(rows.length ? rows : [h("li", { class: "soft" }, t("chapters.none"))]));
  }

  function row(file, trial) {
    const standing = trial.corrections.filter((correction) => !correction.undone);
    const undone = trial.corrections.filter((correction) => correction.undone);
    const place = h("div", {});
    const open = () => toggle(change, place, file, trial);
    const change = h("button", { class: "clinicians", "aria-expanded": "false", onclick: open }, t("trials.change"));
    return h(
      "li",
      { class: standing.some((correction) => correction.kind === "exclude") && "out" },
      h(
        "div",
        { class: "trial" },
        h("span", { class: "name" }, trial.name),
        h("span", { class: "soft" }, t("trials.when", { clock: clock(trial.onset), seconds: trial.duration.toFixed(0) })),
        badge(standing),
        change,
      ),
      trial.pauses.map((p) => h("p", { class: "soft small" }, t("trials.pause", within(p.onset, p.onset + p.duration, trial)))),
      standing.map((correction) => noteOf(correction, trial)),
      undone.length > 0 && h("details", { class: "small" }, h("summary", {}, t("trials.undone")), undone.map((one) => past(one, trial))),
      place,
    );
  }

  function noteOf(correction, trial) {
    const undo = h("button", { class: "plain clinicians", onclick: () => once(undo, box, () => takeBack(correction)) }, t("trials.undo"));
    return h("p", { class: "correction" }, h("span", {}, correctionWords(correction, trial)), undo);
  }

  async function takeBack(correction) {
    const answer = await api.remove(`/api/corrections/${correction.id}`);
    await recomputed(answer.results);
  }

  function toggle(button, place, file, trial) {
    const opened = button.getAttribute("aria-expanded") === "true";
    open();
    if (opened) return;
    const send = async (wanted) => {
      const answer = await api.post(`/api/recordings/${file.id}/corrections`, wanted);
      await recomputed(answer.results);
    };
    const leave = correcting.mount(place, api, { result, trial, send });
    button.setAttribute("aria-expanded", "true");
    open = () => {
      leave();
      place.replaceChildren();
      button.setAttribute("aria-expanded", "false");
      open = () => {};
    };
  }

  return () => {
    gone = true;
    open();
  };
}

/** The tasks of a recording in order: { event, name, onset, duration, tapping, corrections }. */
export function trialsOf(file, titles) {
  const tasks = (file?.summary.events ?? [])
    .map((event, k) => ({ ...event, event: k }))
    .filter((event) => event.trial_type === "task");
  const counts = new Map();
  return tasks.map((task) => {
    const trial = (counts.get(task.task) ?? 0) + 1;
    counts.set(task.task, trial);
    const title = titles.get(task.task) ?? (task.task ?? "").replaceAll("_", " ");
    const several = tasks.filter((other) => other.task === task.task).length > 1;
    const corrections = file.corrections.filter((correction) => correction.event === task.event);
    const ends = task.onset + task.duration;
    const pauses = file.summary.events.filter((e) => e.phase === "pause" && e.onset >= task.onset && e.onset <= ends);
    const tapping = /tap/i.test(task.task ?? "");
    return { ...task, name: several ? t("tapping.trial", { title, number: trial }) : title, tapping, pauses, corrections };
  });
}

function badge(standing) {
  const kinds = standing.map((correction) => correction.kind);
  const kind = kinds.includes("exclude") ? "exclude" : (kinds[0] ?? "none");
  return h("span", { class: `badge ${kind === "none" ? "good" : "warn"}` }, t(`trials.state.${kind}`));
}

function correctionWords(correction, trial) {
  const range = within(correction.onset, correction.end, trial);
  const reason = correction.reason_code ? t(`correct.reason.${correction.reason_code}`) : correction.reason;
  return t(`trials.told.${correction.kind}`, { ...range, reason });
}

/** A stretch in seconds of the trial. */
function within(onset, end, trial) {
  const seconds = (moment) => decimal(Math.max(0, moment - trial.onset), 1);
  return { from: seconds(onset), to: seconds(end) };
}

function past(correction, trial) {
  return h("p", { class: "soft" }, t("trials.past", { what: correctionWords(correction, trial), moment: dayAndTime(correction.undone) }));
}
