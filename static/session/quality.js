/** Whether the numbers can be trusted: answer, questions, why, which sensors and what to do; the rest is folded. */
import { h } from "../dom.js";
import { inWords, segmentWords } from "../words/clinical.js";
import { counted, decimal, t } from "../words/words.js";

const LOOK = { yes: "good", mostly: "fair", no: "poor" };

export function mount(root, api, { result }) {
  const { warnings, readings } = result;
  const { answer, words, reasons, questions, findings, todo, untested } = readings.trust;
  const others = warnings.filter((text) => ![...questions, ...findings].includes(text));
  const list = (each) =>
    h(
      "ul",
      {},
      each.map((text) => h("li", {}, text)),
    );
  const folded = (words, ...inside) => h("details", { class: "more" }, h("summary", {}, words), inside);
  const details = readings.calibration ? calibration(readings.calibration) : h("p", { class: "soft" }, t("quality.uncalibrated"));
  root.append(
    h("h2", {}, t("quality.title")),
    h("p", { class: `trust ${LOOK[answer]}` }, words),
    ...(questions.length ? [h("h3", {}, t("quality.questions")), list(questions.map(inWords))] : []),
    ...(reasons.length ? [list(reasons)] : []),
    ...(readings.calibration?.joints ?? []).map((words) => h("p", {}, words)),
    ...(findings.length ? [h("h3", {}, t("quality.sensors")), list(findings.map(inWords))] : []),
    ...(todo.length ? [h("h3", {}, t("quality.todo")), list(todo)] : []),
    ...(others.length ? [folded(counted("recording_messages", others.length), list(others.map(inWords)))] : []),
    ...(untested.length ? [folded(t("quality.untested"), list(untested))] : []),
    folded(t("quality.calibration"), details),
  );
  return () => {};
}

function calibration(measure) {
  const rows = measure.largest.map((row) => [
    h("dt", {}, t(`quality.${row.name}`)),
    h("dd", {}, t("quality.value", { value: row.value, unit: row.unit.replace("deg", "°"), part: segmentWords(row.segment) })),
  ]);
  return [
    h(
      "p",
      { class: "soft" },
      counted("quality.source", measure.sensors, { ...measure, from: decimal(measure.onset, 1), to: decimal(measure.end, 1) }),
    ),
    h("dl", { class: "facts" }, rows),
  ];
}
