/** What is drawn below and on top of a small plot's lines. */
import { drawBand } from "../plots/band.js";
import { colour } from "../plots/plot.js";

const OVER = 0.7; // of the goal's colour, so that the band below it is seen
const NEAR = 18; // px between two treatments from which each has its number

/** The band of measurement error from its session on, the goal over it, the reference, and treatment as numbered lines. */
export function under(drawn, { band, reference, goal, events }) {
  const { ctx, bbox } = drawn;
  const y = (value) => drawn.valToPos(value, "y", true);
  ctx.save();
  if (band) {
    const from = Math.max(bbox.left, drawn.valToPos(band.from, "x", true) - 6 * devicePixelRatio);
    ctx.fillStyle = colour("--surface-sunk");
    ctx.fillRect(from, y(band.high), bbox.left + bbox.width - from, y(band.low) - y(band.high));
  }
  if (goal) drawBand(drawn, goal, OVER);
  if (reference !== undefined) {
    ctx.strokeStyle = colour("--ink-soft");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
    line(ctx, [bbox.left, y(reference)], [bbox.left + bbox.width, y(reference)]);
  }
  eventLines(drawn, events);
  ctx.restore();
}

/** A line each; numbers that would lie on each other stand together. */
function eventLines({ ctx, bbox, root, ...drawn }, events) {
  const places = events.map((event) => ({ x: drawn.valToPos(event.x, "x", true), words: String(event.number) }));
  ctx.strokeStyle = ctx.fillStyle = colour("--curve-4");
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([]);
  places.forEach(({ x }) => line(ctx, [x, bbox.top], [x, bbox.top + bbox.height]));
  ctx.font = `600 ${14 * devicePixelRatio}px ${getComputedStyle(root).fontFamily}`;
  ctx.textAlign = "center";
  ctx.textBaseline = "bottom";
  const labels = [];
  for (const place of places) {
    const last = labels.at(-1);
    if (last && place.x - last.x < NEAR * devicePixelRatio) last.words += `, ${place.words}`;
    else labels.push({ ...place });
  }
  labels.forEach(({ x, words }) => ctx.fillText(words, x, bbox.top - 2 * devicePixelRatio));
}

function line(ctx, from, to) {
  ctx.beginPath();
  ctx.moveTo(...from);
  ctx.lineTo(...to);
  ctx.stroke();
}

/** Diamonds on what is beyond the band, distinguished by shape and colour. */
export function marks(drawn, points, chosen) {
  const { ctx } = drawn;
  const size = 8 * devicePixelRatio;
  ctx.fillStyle = colour("--curve-2");
  points
    .filter((point) => (chosen.against === "first" ? point.first : point === points.at(-1) && point.before))
    .forEach((point) => {
      const [x, y] = [drawn.valToPos(point.x, "x", true), drawn.valToPos(point.value, "y", true)];
      ctx.beginPath();
      [[0, -size], [size, 0], [0, size], [-size, 0]].forEach(([dx, dy]) => ctx.lineTo(x + dx, y + dy)); // prettier-ignore
      ctx.fill();
    });
}
