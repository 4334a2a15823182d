/** The three figures that changed most, above everything else on the patient's page; a press leads to their course. */
import { h, s } from "../dom.js";
import { together } from "../words/joined.js";
import { known, day, t } from "../words/words.js";
import { changeWords, judged, labelWords, valueWords } from "./figure_words.js";

const MOST = 3;
const [WIDE, HIGH, EDGE] = [72, 28, 3]; // of the small line
const FIRST = { against: "first" };

/** Whether a hand was measured twice, so that something can be compared. */
export function isRepeated(sessions) {
  const hands = sessions.map((session) => session.hand);
  return hands.some((hand, k) => hands.indexOf(hand) !== k);
}

/** The hands with a course, the affected one first. */
export function handsOf(payload) {
  const hands = Object.keys(payload.sessions).filter((hand) => payload.series.some((series) => hasCourse(series, hand)));
  const first = (hand) => (hand === payload.affected ? 1 : 0);
  return hands.sort((a, b) => first(b) - first(a) || payload.sessions[b].length - payload.sessions[a].length);
}

export const hasCourse = (series, hand) => (series.hands[hand]?.points.length ?? 0) > 1;

export function mount(root, api, { course }) {
  root.append(h("h2", { class: "visually-hidden" }, t("headlines.title")));
  const tiles = h("div", { class: "glance-tiles", "aria-busy": "true" });
  root.append(tiles);
  let gone = false;
  course.first.then(
    ([payload, titles]) => gone || draw(payload, titles),
    () => (root.hidden = true), // the course below says what is wrong
  );

  function draw(payload, titles) {
    const [hand] = handsOf(payload);
    const chosen = { ...FIRST, hand };
    const figures = hand ? weightiest(payload, chosen) : [];
    root.hidden = !figures.length;
    tiles.removeAttribute("aria-busy");
    tiles.replaceChildren(...figures.map((series) => tile(payload, series, chosen, titles, course.show)));
  }

  return () => {
    gone = true;
  };
}

/** Important figures first, and of them those that changed most in units of measurement error. */
function weightiest(payload, chosen) {
  const weight = (series) => {
    const { mdc95 } = payload.judges[series.hands[chosen.hand].judge];
    const { value, then } = judged(series, chosen);
    return mdc95 ? Math.abs(value - then) / mdc95 : -1;
  };
  const all = payload.series.filter((series) => series.important && hasCourse(series, chosen.hand));
  return all.sort((a, b) => weight(b) - weight(a)).slice(0, MOST);
}

function tile(payload, series, chosen, titles, show) {
  const { value, beyond } = judged(series, chosen);
  const { points, judge } = series.hands[chosen.hand];
  const verdict = beyond === null ? "unknown" : beyond ? "beyond" : "within";
  const since = day(payload.sessions[chosen.hand].find((session) => session.session === points[0][0]).started);
  const of = [known(`hand.${chosen.hand}.title`, ""), titles.get(series.task)].filter(Boolean).join(" · ");
  return h(
    "button",
    { class: `glance-tile ${verdict}`, type: "button", onclick: show },
    h("span", { class: "soft small of" }, of),
    h("span", { class: "figure" }, labelWords(series)),
    h("span", { class: "value" }, together(valueWords(series, value))),
    line(points.map(([, number]) => number), payload.judges[judge].mdc95), // prettier-ignore
    h("span", { class: "small judgement" }, together(t(`course.glance.${verdict}`, { change: changeWords(series, chosen), since }))),
  );
}

/** The course as a small line whose height spans at least the measurement error. */
function line(values, mdc95) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const span = Math.max(high - low, mdc95 ?? 0.2 * Math.abs(values[0])) || 1;
  const from = (low + high - span) / 2;
  const x = (k) => EDGE + (k / (values.length - 1)) * (WIDE - 2 * EDGE);
  const y = (value) => HIGH - EDGE - ((value - from) / span) * (HIGH - 2 * EDGE);
  const path = values.map((value, k) => `${k ? "L" : "M"}${x(k).toFixed(1)} ${y(value).toFixed(1)}`).join("");
  const end = { cx: x(values.length - 1).toFixed(1), cy: y(values.at(-1)).toFixed(1), r: 3 };
  return s("svg", { class: "spark", viewBox: `0 0 ${WIDE} ${HIGH}`, "aria-hidden": "true" }, s("path", { d: path }), s("circle", end));
}
