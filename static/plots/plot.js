/** A curve plot in the page's colours: follows its box and the colour scheme; drawn by uPlot. */
import { watchTheme } from "../theme.js";
import uPlot from "../vendor/uplot/uPlot.esm.js";
import { plain } from "../words/words.js";
import { widening } from "./axis_width.js";

/**
 * wanted.label    what a screen reader says
 * wanted.lines    [{ colour: "--curve-1", dash, bars, points, dots }]; points: their size in px, across gaps; dots: the same without a line
 * wanted.words    (value) => text of a y tick
 * wanted.xWords   (value) => text of an x tick
 * wanted.xTicks   (values) => texts of all x ticks, in place of xWords
 * wanted.steps, xSteps  distances that ticks may have
 * wanted.axis     px for the texts of y ticks (76); `widens`: more where a text needs more, and never less again
 * wanted.space    least px between y ticks (34)
 * wanted.also     x values that stay in sight
 * wanted.top      px above the plot (10)
 * wanted.window   (newest x) => [from, to]; else all data
 * wanted.under    (plot) => anything drawn below the lines
 * wanted.drawn    (plot) => anything drawn on top
 * wanted.right    px beside the plot, where labels are long
 * wanted.air      least room beyond the data, of their unit (2)
 * wanted.low, high  values that stay in sight; then zero need not be
 * wanted.falls   less of the value is further up
 * wanted.pressed  (x) => a press at x
 */
export function makePlot(root, wanted) {
  let data = [[], ...wanted.lines.map(() => [])];
  let plot = null;
  root.classList.add("plot");
  root.setAttribute("role", "img");
  root.setAttribute("aria-label", wanted.label);

  function make() {
    plot?.destroy();
    plot = new uPlot(optionsOf(wanted, root), data, root);
  }

  const observer = new ResizeObserver(() => (plot ? plot.setSize(sizeOf(root)) : make()));
  observer.observe(root);
  const unwatch = watchTheme(make);
  let gone = false;
  document.fonts.ready.then(() => gone || (plot && make()));
  const press = (event) => plot && wanted.pressed?.(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  root.addEventListener("click", press);
  return {
    get plot() {
      return plot;
    },
    set(now) {
      data = now;
      plot?.setData(data);
    },
    destroy() {
      gone = true;
      observer.disconnect();
      unwatch();
      root.removeEventListener("click", press);
      plot?.destroy();
    },
  };
}

/** A colour of colors.css as it is now. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** @returns {uPlot.Options} */
function optionsOf(wanted, root) {
  const axis = {
    stroke: colour("--ink-soft"),
    grid: { stroke: colour("--grid"), width: 1 },
    ticks: { show: false },
    font: `14px ${getComputedStyle(root).fontFamily}`,
  };
  return {
    ...sizeOf(root),
    padding: [wanted.top ?? 10, wanted.right ?? 14, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: (u, low, high) => xRange(wanted, low, high) },
      y: { dir: wanted.falls ? -1 : 1, range: (u, low, high) => yRange(wanted, low, high) },
    },
    axes: [
      { ...axis, size: 30, ...incrs(wanted.xSteps), values: (u, ticks) => wanted.xTicks?.(ticks) ?? ticks.map(wanted.xWords ?? plain) },
      {
        ...axis,
        size: wanted.widens ? widening(wanted.axis) : (wanted.axis ?? 76),
        space: wanted.space ?? 34,
        ...incrs(wanted.steps),
        values: (u, ticks) => ticks.map(wanted.words),
      },
    ],
    series: [{}, ...wanted.lines.map(lineOf)],
    hooks: { drawAxes: wanted.under ? [wanted.under] : [], draw: wanted.drawn ? [wanted.drawn] : [] },
  };
}

const incrs = (steps) => (steps ? { incrs: steps } : {});

function lineOf(line) {
  const stroke = colour(line.colour);
  const bars = line.bars ? { paths: uPlot.paths.bars({ size: [0.6, 28] }), fill: stroke } : {};
  const size = line.points ?? line.dots;
  const points = size ? { show: true, size, fill: stroke } : { show: false };
  const alone = line.dots ? { paths: () => null } : {};
  return { stroke, width: 2, dash: line.dash, points, spanGaps: Boolean(line.points), ...bars, ...alone };
}

/** @returns {[number, number]} */
function xRange(wanted, low, high) {
  if (wanted.window) return wanted.window(high ?? 0);
  const also = wanted.also ?? [];
  const [least, most] = low === null ? [low, high] : [Math.min(low, ...also), Math.max(high, ...also)];
  return least === null || least === most
    ? [(least ?? 0) - 1, (most ?? 0) + 1]
    : wanted.around
      ? [least - wanted.around, most + wanted.around]
      : [least, most];
}

/**
 * Zero is in it unless other values are to be, with a little air beyond the data, so that a still hand is a flat line.
 * @returns {[number, number]}
 */
function yRange(wanted, low, high) {
  if (low === null) return [0, 10];
  if (wanted.low !== undefined) {
    const [least, most] = [Math.min(low, wanted.low), Math.max(high, wanted.high)];
    const air = 0.08 * Math.max(most - least, 1e-3);
    return [least - air, most + air];
  }
  const air = Math.max(wanted.air ?? 2, 0.08 * (Math.max(high, 0) - Math.min(low, 0)), 1e-6);
  return [low < 0 ? low - air : 0, high > 0 ? high + air : 0];
}

function sizeOf(root) {
  return { width: Math.max(80, root.clientWidth), height: Math.max(60, root.clientHeight) };
}
