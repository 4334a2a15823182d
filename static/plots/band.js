/** A band of values that are aimed at, below the lines of a plot. */
import { colour } from "./plot.js";

export function drawBand({ ctx, bbox, ...drawn }, { low, high }) {
  const [top, bottom] = [high, low].map((value) => drawn.valToPos(value, "y", true));
  ctx.save();
  ctx.fillStyle = colour("--good-soft");
  ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
  ctx.fillStyle = colour("--good");
  for (const edge of [top, bottom]) ctx.fillRect(bbox.left, edge - devicePixelRatio / 2, bbox.width, devicePixelRatio);
  ctx.restore();
}
