/** One figure over the sessions: its newest value large, what to make of it in words, and the small plot. */
import { h } from "../dom.js";
import { makePlot } from "../plots/plot.js";
import { together } from "../words/joined.js";
import { t } from "../words/words.js";
import { dayNumber, dayOf, STEPS, tickDays } from "./days.js";
import { changeWords, judged, labelWords, stepsOf, tickWords, valueWords } from "./figure_words.js";
import { drawGoal, words as goalWords } from "./goal.js";
import { marks, under } from "./small_marks.js";

const BEFORE = 60; // days before the first session in which treatment stands in the plot
const UNKNOWN = [0.9, 1.1]; // parts of a value that its axis spans where no measurement error is known

/** `aim`: { api, patient, reload } where goals may be set; `task`: its title where the view holds several. */
export function drawSmall(root, payload, series, chosen, { aim, task }) {
  const { value, beyond } = judged(series, chosen);
  const course = series.hands[chosen.hand];
  const { mdc95 } = payload.judges[course.judge];
  const place = h("div", { class: "small-plot" });
  const verdict = beyond === null ? "unknown" : beyond ? "beyond" : "within";
  const goal = series.goals[chosen.hand];
  const aims = h("div", {});
  if (aim) drawGoal(aims, series, chosen.hand, aim);
  root.append(
    h(
      "section",
      { class: `multiple ${verdict}` },
      h("h3", {}, labelWords(series)),
      task && h("p", { class: "soft small" }, task),
      h("p", { class: "value" }, together(valueWords(series, value))),
      h("p", { class: "judgement" }, together(t(`course.verdict.${verdict}`, { change: changeWords(series, chosen) }))),
      goal && h("p", { class: "small" }, goalWords(series, goal)),
      place,
      aims,
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
  const events = eventsOf(payload, chosen.hand, moments);
  const bounds = [band?.low, band?.high, reference, goal?.low, goal?.high];
  const seen = [base.value, ...bounds.filter((number) => number !== undefined && number !== null)];
  if (!band) seen.push(...UNKNOWN.map((part) => part * base.value));
  const plot = makePlot(place, {
    label: t("course.plot", { figure: labelWords(series), values: own.map((point) => valueWords(series, point.value)).join(", ") }),
    lines: [
      { colour: "--ink", points: 8 },
      { colour: "--curve-3", dash: [5, 5], points: 6 },
    ],
    words: (tick) => tickWords(series, tick),
    xTicks: tickDays,
    xSteps: STEPS,
    steps: stepsOf(series),
    also: events.map((event) => event.x),
    top: events.length ? 22 : 10,
    axis: series.joint && (series.end === "smallest" || series.angle !== "flexion") ? 108 : 52,
    around: 1,
    space: 26,
    right: 24,
    low: Math.min(...seen),
    high: Math.max(...seen),
    falls: series.end === "smallest", // more extension is less of the angle
    under: (drawn) => under(drawn, { band, reference, goal, events }),
    drawn: (drawn) => marks(drawn, own, chosen),
  });
  plot.set([moments, valuesOf(own), valuesOf(other ?? [])]);
  return plot.destroy;
}

/** A hand's points { x in days, value, first, before }. */
function pointsOf(payload, series, hand) {
  const started = new Map(payload.sessions[hand].map((s) => [s.session, dayOf(s.started)]));
  return (series.hands[hand]?.points ?? []).map(([session, value, first, before]) => ({ x: started.get(session), value, first, before }));
}

/** Treatment of a hand with its number in the list: what lies long before the first session stands in the list alone. */
function eventsOf(payload, hand, moments) {
  const from = moments[0] - Math.max(BEFORE, moments.at(-1) - moments[0]);
  return payload.treatment_events
    .map((event, k) => ({ x: dayNumber(event.day), number: k + 1, hand: event.hand }))
    .filter((event) => (event.hand === hand || event.hand === "both") && event.x >= from);
}
