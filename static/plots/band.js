/** A band of values that are aimed at, below the lines of a plot; `alpha` of its area where something below it is to be seen. */
import { colour } from "./plot.js";

export function drawBand({ ctx, bbox, ...drawn }, { low, high }, alpha = 1) {
  const [top, bottom] = [high, low].map((value) => drawn.valToPos(value, "y", true));
  ctx.save();
  ctx.globalAlpha = alpha;
  ctx.fillStyle = colour("--good-soft");
  ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
  ctx.globalAlpha = 1;
  ctx.fillStyle = colour("--good");
  for (const edge of [top, bottom]) ctx.fillRect(bbox.left, edge - devicePixelRatio / 2, bbox.width, devicePixelRatio);
  ctx.restore();
}
