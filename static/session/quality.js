/** Whether the numbers can be trusted: the answer first, why and what to do; messages and the calibration are folded away. */
import { h } from "../dom.js";
import { inWords, segmentWords } from "../words/clinical.js";
import { counted, decimal, t } from "../words/words.js";

const LOOK = { yes: "good", mostly: "fair", no: "poor" };

export function mount(root, api, { result }) {
  const { warnings, readings } = result;
  const { answer, words, reasons, todo, untested } = readings.trust;
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
    ...(reasons.length ? [list(reasons)] : []),
    ...(todo.length ? [h("h3", {}, t("quality.todo")), list(todo)] : []),
    ...(warnings.length ? [folded(counted("recording_messages", warnings.length), list(warnings.map(inWords)))] : []),
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
      t("quality.source", { ...measure, from: decimal(measure.onset, 1), to: decimal(measure.end, 1) }),
    ),
    h("dl", { class: "facts" }, rows),
  ];
}
