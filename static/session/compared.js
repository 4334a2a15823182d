/** Two curves on one clock; of one recording their difference and how far they agree. */
import { h } from "../dom.js";
import { legend } from "../plots/legend.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, valueWords } from "../words/clinical.js";
import { decimal, t } from "../words/words.js";

export function mount(root, api, { told, what, names }) {
  const [both, apart] = [h("div", { class: "tall" }), h("div", { class: "short" })];
  const common = { xWords: (moment) => t("correct.seconds", { seconds: moment.toFixed(0) }), axis: 96 };
  const more = told.agreement
    ? [h("h3", {}, t("compare.difference")), apart, agreement(told.agreement)]
    : [h("p", { class: "hint" }, t("compare.aligned"))];
  root.replaceChildren(legend(names), both, ...more);
  const lines = makePlot(both, {
    ...common,
    label: t("compare.label", { what: curveWords(what), a: names[0], b: names[1] }),
    lines: [{ colour: "--curve-1" }, { colour: "--curve-2", dash: [8, 4] }],
    words: (value) => valueWords(what, value),
  });
  lines.set([told.t, told.a, told.b]);
  if (!told.agreement) return lines.destroy;
  const unit = unitOf(told.agreement);
  const difference = makePlot(apart, {
    ...common,
    label: t("compare.difference"),
    lines: [{ colour: "--curve-4" }],
    words: (value) => apartWords(value, unit),
  });
  difference.set([told.t, told.difference]);
  return () => {
    lines.destroy();
    difference.destroy();
  };
}

const unitOf = (told) => (told.unit === "deg" ? "°" : ` ${told.unit}`);

/** A direction in words, never a bare minus. */
function apartWords(value, unit) {
  const size = `${decimal(Math.abs(value), 1).replace(/\D0$/, "")}${unit}`;
  return value ? t(value > 0 ? "compare.above" : "compare.below", { size }) : size;
}

function agreement(told) {
  const rows = ["drms", "drms_minus_offset", "rom_a", "rom_b"].map((name) => [name, `${decimal(told[name], 1)}${unitOf(told)}`]);
  rows.splice(1, 0, ["offset", apartWords(Number(told.offset.toFixed(1)), unitOf(told))]);
  return h(
    "dl",
    { class: "facts" },
    rows.map(([name, words]) => [h("dt", {}, t(`compare.${name}`)), h("dd", {}, words)]),
  );
}
