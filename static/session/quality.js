/** How far the numbers can be trusted: warnings in words, and how the calibration went. */
import { h } from "../dom.js";
import { segmentWords } from "../words/clinical.js";
import { t } from "../words/words.js";

export function mount(root, api, { result }) {
  const { warnings, readings } = result;
  root.append(
    h("h2", {}, t("quality.title")),
    warnings.length
      ? h(
          "div",
          { class: "warning" },
          h(
            "ul",
            {},
            warnings.map((words) => h("li", {}, readable(words))),
          ),
        )
      : noticed(readings),
    h("h3", {}, t("quality.calibration")),
    h("div", {}, readings.calibration ? calibration(readings.calibration) : h("p", { class: "soft" }, t("quality.uncalibrated"))),
  );
  return () => {};
}

/** Without a warning: whether every figure can be trusted. */
function noticed({ others }) {
  const doubted = others.filter((measure) => measure.advice.length).map((measure) => measure.title);
  if (doubted.length) return h("div", { class: "warning" }, h("p", {}, t("quality.figures", { titles: doubted.join(", ") })));
  return h("p", {}, h("span", { class: "badge good" }, "✓"), " ", t("quality.fine"));
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
      t("quality.source", { source: measure.source, sensors: measure.sensors, from: measure.onset.toFixed(1), to: measure.end.toFixed(1) }),
    ),
    h("dl", { class: "facts" }, rows),
  ];
}

/** A warning begins with a segment's name where it is about one. */
function readable(words) {
  return words.replaceAll("_", " ");
}
