/** Two curves on one clock; of one recording their difference and how far they agree. */
import { h } from "../dom.js";
import { legend } from "../plots/legend.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, valueWords } from "../words/clinical.js";
import { decimal, t } from "../words/words.js";

export function mount(root, api, { payload, what, names }) {
  const [both, differencePlot] = [h("div", { class: "tall" }), h("div", { class: "short" })];
  const common = { xWords: (moment) => t("correct.seconds", { seconds: moment.toFixed(0) }), axis: 96 };
  const more = payload.agreement
    ? [h("h3", {}, t("compare.difference")), differencePlot, agreement(payload.agreement)]
    : [h("p", { class: "hint" }, t("compare.aligned"))];
  root.replaceChildren(legend(names), both, ...more);
  const lines = makePlot(both, {
    ...common,
    label: t("compare.label", { what: curveWords(what), a: names[0], b: names[1] }),
    lines: [{ colour: "--curve-1" }, { colour: "--curve-2", dash: [8, 4] }],
    words: (value) => valueWords(what, value),
  });
  lines.set([payload.t, payload.a, payload.b]);
  if (!payload.agreement) return lines.destroy;
  const unit = unitOf(payload.agreement);
  const difference = makePlot(differencePlot, {
    ...common,
    label: t("compare.difference"),
    lines: [{ colour: "--curve-4" }],
    words: (value) => differenceWords(value, unit),
  });
  difference.set([payload.t, payload.difference]);
  return () => {
    lines.destroy();
    difference.destroy();
  };
}

const unitOf = (payload) => (payload.unit === "deg" ? "°" : ` ${payload.unit}`);

/** A direction in words, with "above" or "below" instead of a minus sign. */
export function differenceWords(value, unit) {
  const size = `${decimal(Math.abs(value), 1).replace(/\D0$/, "")}${unit}`;
  return value ? t(value > 0 ? "compare.above" : "compare.below", { size }) : size;
}

function agreement(payload) {
  const rows = ["drms", "drms_minus_offset", "rom_a", "rom_b"].map((name) => [name, `${decimal(payload[name], 1)}${unitOf(payload)}`]);
  rows.splice(1, 0, ["offset", differenceWords(Number(payload.offset.toFixed(1)), unitOf(payload))]);
  return h(
    "dl",
    { class: "facts" },
    rows.map(([name, words]) => [h("dt", {}, t(`compare.${name}`)), h("dd", {}, words)]),
  );
}
