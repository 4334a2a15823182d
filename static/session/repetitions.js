/** Repetitions of a task that were found in its movement: marked on its curve, and chosen by a press. */
import { h } from "../dom.js";
import { colour } from "../plots/plot.js";
import { t } from "../words/words.js";

/** Where each repetition begins and ends, and its number. */
export function number({ ctx, bbox }, each, at) {
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = colour("--ink-soft");
  ctx.setLineDash([4, 4]);
  ctx.textAlign = "center";
  each.forEach((one, k) => {
    const [left, right] = [at(one.start), at(one.stop)];
    [left, right].forEach((x) => ctx.strokeRect(x, bbox.top, 0, bbox.height));
    ctx.fillText(k + 1, (left + right) / 2, bbox.top + 14 * devicePixelRatio);
  });
  ctx.restore();
}

/** Chooses it; one that is left out is shown and cannot be chosen. */
export function repetition(one, number, chosen) {
  const words = t(one.out ? "correct.repetition.out" : "correct.repetition", { number });
  return h("button", { type: "button", disabled: one.out, "aria-label": words, title: words, onclick: chosen }, String(number));
}
