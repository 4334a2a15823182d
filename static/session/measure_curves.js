/** The curves of a measure, trial by trial: what was measured over time, or one quantity over another. */
import { h } from "../dom.js";
import { legend } from "../plots/legend.js";
import { colour, makePlot } from "../plots/plot.js";
import { labelled } from "../words/joined.js";
import { decimal, plain } from "../words/words.js";

const LINES = [{ colour: "--curve-1" }, { colour: "--curve-2", dash: [8, 5] }];
const BOUND = { colour: "--curve-1", dash: [2, 4] };
const DOTS = "force_over_distance";

/** Draws below `root`; gives back how to take the plots away. */
export function mount(root, { curves, marks }) {
  const plots = curves.flatMap(([trial, panels]) => {
    const row = h("div", { class: "panels" });
    root.append(trial && h("h3", {}, trial), row);
    return panels.map((panel) => draw(row, panel, trial));
  });
  if (marks && plots.length) root.append(h("p", { class: "hint" }, marks));
  return () => plots.forEach((plot) => plot.destroy());
}

function draw(row, panel, trial) {
  const names = panel.lines.map((line) => line.name).filter(Boolean);
  const most = Math.max(...panel.lines.flatMap((line) => line.y).map(Math.abs));
  const digits = most < 2 ? 2 : most < 20 ? 1 : 0;
  const place = h("div", { class: "low" });
  row.append(h("div", {}, h("p", { class: "of" }, panel.title), names.length > 1 && legend(names), place));
  const plot = makePlot(place, {
    label: trial ? labelled(trial, panel.title) : panel.title,
    lines: panel.lines.map((line, k) => lineOf(panel, k, names.length > 1)),
    words: (value) => decimal(value, digits),
    xWords: (value) => (panel.x_unit === "s" ? `${plain(value)} s` : plain(value)),
    air: 0,
    under: (drawn) => upright(drawn, panel.marks),
  });
  plot.set([panel.x, ...panel.lines.map((line) => line.y)]);
  return plot;
}

function lineOf(panel, k, named) {
  if (panel.name === DOTS) return k ? { colour: "--curve-2" } : { ...LINES[0], dots: 3 };
  return named || !k ? LINES[k] : BOUND;
}

function upright(plot, moments) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = colour("--curve-mark");
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash([4 * devicePixelRatio, 4 * devicePixelRatio]);
  moments.forEach((moment) => {
    const x = plot.valToPos(moment, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
  });
  ctx.restore();
}
