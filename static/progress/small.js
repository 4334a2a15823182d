/** One figure over the sessions: its newest value large, what to make of it in words, and the small plot. */
import { h } from "../dom.js";
import { colour, makePlot } from "../plots/plot.js";
import { shortDay, t } from "../words/words.js";
import { changeWords, judged, labelWords, valueWords } from "./figure_words.js";

const DAY = 86_400_000; // ms

export function drawSmall(root, payload, series, chosen) {
  const { value, beyond } = judged(series, chosen);
  const course = series.hands[chosen.hand];
  const { mdc95 } = payload.judges[course.judge];
  const place = h("div", { class: "small-plot" });
  const verdict = beyond === null ? "unknown" : beyond ? "beyond" : "within";
  root.append(
    h(
      "section",
      { class: `multiple ${verdict}` },
      h("h3", {}, labelWords(series)),
      h("p", { class: "value" }, valueWords(series, value)),
      h("p", { class: "judgement" }, t(`course.verdict.${verdict}`, { change: changeWords(series, chosen) })),
      place,
    ),
  );
  const [own, other] = [chosen.hand, ...Object.keys(series.hands).filter((hand) => hand !== chosen.hand)].map((hand) =>
    hand ? pointsOf(payload, series, hand) : [],
  );
  const moments = [...new Set([...own, ...(other ?? [])].map((point) => point.x))].sort((a, b) => a - b);
  const valuesOf = (points) => moments.map((x) => points.find((point) => point.x === x)?.value ?? null);
  const base = chosen.against === "first" ? own[0] : own.at(-2);
  const band = mdc95 === null ? null : { low: base.value - mdc95, high: base.value + mdc95, from: base.x };
  const reference = series.reference?.value;
  const seen = [base.value, band?.low, band?.high, reference].filter((number) => number !== undefined && number !== null);
  const plot = makePlot(place, {
    label: t("course.plot", { figure: labelWords(series), values: own.map((point) => valueWords(series, point.value)).join(", ") }),
    lines: [
      { colour: "--ink", points: 8 },
      { colour: "--curve-3", dash: [5, 5], points: 6 },
    ],
    words: (tick) => tickWords(series, tick),
    xWords: (tick) => shortDay(tick * DAY),
    axis: series.joint && (series.end === "smallest" || series.angle !== "flexion") ? 108 : 52,
    around: 1,
    right: 24,
    low: Math.min(...seen),
    high: Math.max(...seen),
    under: (drawn) => under(drawn, band, reference),
    drawn: (drawn) => marks(drawn, own, chosen),
  });
  plot.set([moments, valuesOf(own), valuesOf(other ?? [])]);
  return plot.destroy;
}

/** A direction stands at every tick where values lie on either side of zero. */
function tickWords(series, tick) {
  if (!series.joint) return String(Number(tick.toFixed(2)));
  return series.end === "largest" && series.angle === "flexion" && tick >= 0 ? `${Math.round(tick)}°` : valueWords(series, tick);
}

/** A hand's points { x in days, value, first, before }. */
function pointsOf(payload, series, hand) {
  const started = new Map(payload.sessions[hand].map((s) => [s.session, new Date(s.started).getTime() / DAY]));
  return (series.hands[hand]?.points ?? []).map(([session, value, first, before]) => ({ x: started.get(session), value, first, before }));
}

/** The band of measurement error, from its session on, and the reference. */
function under(drawn, band, reference) {
  const { ctx, bbox } = drawn;
  const y = (value) => drawn.valToPos(value, "y", true);
  ctx.save();
  if (band) {
    const from = Math.max(bbox.left, drawn.valToPos(band.from, "x", true) - 6 * devicePixelRatio);
    ctx.fillStyle = colour("--surface-sunk");
    ctx.fillRect(from, y(band.high), bbox.left + bbox.width - from, y(band.low) - y(band.high));
  }
  if (reference !== undefined) {
    ctx.strokeStyle = colour("--ink-soft");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y(reference));
    ctx.lineTo(bbox.left + bbox.width, y(reference));
    ctx.stroke();
  }
  ctx.restore();
}

/** Diamonds on what is beyond the band, distinguished by shape and colour. */
function marks(drawn, points, chosen) {
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
