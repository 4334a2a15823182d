/** The newest seconds of the quantity under test, and the band that the task's demonstration reaches. */
import { h, hide, whenChanged } from "../dom.js";
import { drawBand } from "../plots/band.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, valueWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const WINDOW = 15; // s shown
const KEPT = 2000; // points

export function mount(root, api, { station }) {
  const name = h("h3", {});
  const place = h("div", {});
  const hint = h("p", { class: "soft" }, t("curve.waiting"));
  root.append(name, h("div", { class: "plot-box" }, place, hint));
  let what = "aperture";
  let [times, values] = [[], []];
  let drawn = 0;
  let gone = false;
  let target = null;
  const wanted = {
    label: t("curve.live"),
    lines: [{ colour: "--curve-1" }],
    words: (value) => valueWords(what, value),
    xWords: () => null, // no text is drawn, not an empty one
    window: (newest) => [newest - WINDOW, newest],
    axis: 120,
    widens: true,
    under: (drawn) => target && drawBand(drawn, target),
  };
  const plot = makePlot(place, wanted);

  const aim = whenChanged(
    (full) => full.target,
    (now) => {
      target = now && { low: Math.min(...now), high: Math.max(...now) };
      [wanted.low, wanted.high] = target ? [Math.min(0, target.low), Math.max(0, target.high)] : [];
      drawLater();
    },
  );
  const rename = whenChanged(
    ({ curve }) => curve.what,
    (now) => {
      [times, values] = [[], []];
      what = now;
      name.textContent = curveWords(now);
    },
  );

  function take(pulse) {
    if (pulse.what !== what) return;
    for (const [t, value] of pulse.points) {
      if (times.length && t < times[times.length - 1]) [times, values] = [[], []];
      if (times.length && t === times[times.length - 1]) continue;
      times.push(t);
      values.push(value);
    }
    if (times.length > KEPT) [times, values] = [times.slice(-KEPT), values.slice(-KEPT)];
    if (pulse.points.length) drawLater();
  }

  /** Not in the picture in which the message was read, which has enough to do. */
  function drawLater() {
    drawn ||= requestAnimationFrame(() => (drawn = requestAnimationFrame(draw)));
  }

  function draw() {
    drawn = 0;
    if (gone) return;
    hide(hint, times.length > 1);
    const from = times.findIndex((t) => t > times[times.length - 1] - WINDOW);
    plot.set([times.slice(from), values.slice(from)]);
  }

  const leave = [station.on("full", rename), station.on("full", aim), station.on("pulse", take)];
  return () => {
    gone = true;
    leave.forEach((stop) => stop());
    cancelAnimationFrame(drawn);
    plot.destroy();
  };
}
