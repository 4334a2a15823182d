/** Finger tapping: its figures, the distance over time with the taps marked, and the amplitude of every tap. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { colour, makePlot } from "../plots/plot.js";
import { directionsOf } from "../words/directions.js";
import { counted, decimal, known, plain, t } from "../words/words.js";
import { folded } from "./folded.js";

const FIRST = ["count", "rate", "interval_mean", "amplitude_mean", "decrement_ratio"]; // the others are folded away

export function mount(root, api, { result }) {
  const leave = result.readings.tapping.map((trial, k, all) => {
    const place = h("div", { class: "card" });
    root.append(place);
    return one(place, api, result, trial, all.length > 1 ? k + 1 : 0);
  });
  return () => leave.forEach((unmount) => unmount());
}

function one(root, api, result, trial, number) {
  const box = errorBox();
  const [curve, bars] = [h("div", { class: "tall" }), h("div", { class: "tall" })];
  const row = (f) => h("tr", {}, h("th", { scope: "row" }, labelOf(f)), h("td", { class: "number" }, valueOf(f, trial)));
  const caption = () => h("caption", { class: "visually-hidden" }, t("tapping.figures"));
  const table = (figures) => h("table", {}, caption(), h("tbody", {}, figures.map(row)));
  const first = trial.figures.filter((f) => FIRST.includes(shortOf(f)));
  const all = t("measures.all", { count: trial.figures.length });
  root.append(
    h(
      "h2",
      {},
      number ? t("tapping.trial", { title: trial.title, number }) : trial.title,
      " ",
      h("span", { class: `badge ${trial.grade}` }, t("tapping.signal", { grade: known(`grade.${trial.grade}`, trial.grade) })),
    ),
    trial.reason && h("p", { class: trial.grade === "good" ? "hint" : "warning" }, trial.reason), // what lowers nothing warns of nothing
    h(
      "div",
      { class: "halves" },
      h("div", {}, table(first), folded(all, table(trial.figures))),
      h("div", {}, h("h3", {}, t("tapping.amplitudes")), bars),
    ),
    h("h3", {}, t("tapping.curve")),
    curve,
    h("p", { class: "hint" }, t("tapping.caption")),
    box.element,
  );
  const mm = (value) => `${plain(value)} mm`;
  const distance = makePlot(curve, {
    label: counted("tapping.curve.label", trial.amplitudes_mm.length),
    lines: [{ colour: "--curve-1" }],
    words: mm,
    xWords: (s) => `${plain(s)} s`,
    drawn: (plot) => markClosings(plot, trial.closings),
  });
  const amplitudes = makePlot(bars, {
    label: t("tapping.amplitudes.label"),
    lines: [{ colour: "--curve-1", bars: true }],
    words: mm,
    around: 0.6,
  });
  amplitudes.set([trial.amplitudes_mm.map((_, k) => k + 1), trial.amplitudes_mm]);
  const span = `start=${trial.onset}&stop=${trial.end}`;
  let gone = false;
  api.get(`/api/results/${result.id}/curves?what=aperture&${span}&points=3000`).then(
    (payload) => gone || distance.set([payload.t, payload.curves.aperture]),
    (error) => gone || box.show(error),
  );
  return () => {
    gone = true;
    distance.destroy();
    amplitudes.destroy();
  };
}

/** Small triangles at the foot of the plot, one for every closing. */
function markClosings(plot, closings) {
  const { ctx, bbox } = plot;
  const size = 5 * devicePixelRatio;
  ctx.fillStyle = colour("--curve-mark");
  closings.forEach((moment) => {
    const x = plot.valToPos(moment, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top + bbox.height - 2 * size);
    ctx.lineTo(x - size, bbox.top + bbox.height);
    ctx.lineTo(x + size, bbox.top + bbox.height);
    ctx.fill();
  });
}

const shortOf = (figure) => figure.name.replace("tapping_", "");

function labelOf(figure) {
  return known(`tapping.${shortOf(figure)}`, figure.label);
}

function valueOf(figure, trial) {
  if (figure.value === null) return t(trial.amplitudes_mm.length ? "tapping.too_few" : "tapping.not_measured");
  const digits = figure.decimals;
  const size = decimal(Math.abs(figure.value), digits);
  const directions = directionsOf(figure.name);
  if (directions.every(Boolean)) {
    const none = Number(figure.value.toFixed(digits)) === 0;
    return none ? t("tapping.same") : t(`direction.${directions[Number(figure.value > 0)]}`, { size: `${size} ${figure.unit}` });
  }
  const sure = figure.sd >= 0.5 * 10 ** -digits ? ` ± ${decimal(figure.sd, digits)}` : ""; // a deviation below the last digit is left out
  if (figure.unit === "deg") return `${size}${sure}°`;
  return `${size}${sure} ${figure.unit === "Hz" ? t("unit.per_s") : figure.unit}`.trim();
}
