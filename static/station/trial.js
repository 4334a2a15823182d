/** "Keep this one?": the trial's curve with its marks, every finger that counts, three figures beside earlier ones, and what was wrong. */
import { h, icon, whenChanged } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { LINES } from "../plots/curve_sets.js";
import { legend } from "../plots/legend.js";
import { colour, makePlot } from "../plots/plot.js";
import { curveWords, distinctWords, jointName, sameJointWords, segmentWords, valueWords } from "../words/clinical.js";
import { counted, t } from "../words/words.js";

const FLEXION = /_flexion$/; // of whose values above zero the heading says enough
const COLUMNS = ["now", "last", "other"];

export function mount(root, api, { station, strip }) {
  const box = errorBox();
  const path = `/api/stations/${station.name}/trial`;
  const again = h("button", { "data-again": true, onclick: () => once(again, box, () => api.post(`${path}/replays`, {})) });
  const wrong = h("div", { role: "status" });
  const table = h("div", {});
  const frozen = h("div", { class: "frozen", hidden: true });
  let plot = null;
  let asked = 0; // answers to what was asked before the last change come too late
  strip.append(frozen);
  root.append(wrong, table, again, box.element);
  root.hidden = true;

  const draw = whenChanged(
    ({ trial, wizard }) => [trial, wizard.state === "task_review"],
    async ([number, isReviewed]) => {
      drop();
      if (!isReviewed) return;
      say(t("trial.checking"));
      if (!number) return;
      const mine = asked;
      const review = await api.get(path).catch(box.show);
      if (mine !== asked) return;
      if (review) show(review);
      else say(t("trial.unchecked"));
    },
  );
  const drawAgain = whenChanged(
    ({ replaying }) => replaying,
    (replaying) => {
      again.replaceChildren(icon("repeat"), t(replaying ? "trial.replaying" : "trial.again"));
      again.disabled = replaying;
    },
  );

  /** In place of a review, as high as one, so that the buttons below keep their place. */
  function say(words) {
    root.hidden = false;
    wrong.replaceChildren(h("p", { class: "soft" }, words));
  }

  function show(review) {
    frozen.hidden = again.hidden = false;
    strip.classList.add("reviewing");
    wrong.replaceChildren(review.problem ? h("p", { class: "warning" }, problemWords(review.problem)) : good());
    table.replaceChildren(figures(review));
    plot = drawCurves(frozen, review);
  }

  function drop() {
    asked += 1;
    root.hidden = frozen.hidden = true;
    strip.classList.remove("reviewing");
    plot?.destroy();
    plot = null;
    again.hidden = true;
    table.replaceChildren();
    frozen.replaceChildren();
  }

  const leave = [station.on("full", draw), station.on("full", drawAgain)];
  return () => {
    leave.forEach((stop) => stop());
    drop();
  };
}

function good() {
  return h("p", { class: "good-words" }, icon("check"), t("trial.good"));
}

/** What was wrong with the trial, in one sentence. */
function problemWords(problem) {
  const part = problem.part && segmentWords(problem.part);
  if (problem.kind === "few") return counted("trial.problem.few", problem.done, problem);
  return t(`trial.problem.${problem.kind}`, { ...problem, part });
}

/** Figures of this trial, last time's and the other hand's; then how far each finger went. */
function figures({ figures: rows, fingers }) {
  const shown = COLUMNS.filter((name) => name === "now" || rows.some((row) => row[name] !== null));
  const head = h("tr", {}, h("td", {}), shown.map((name) => h("th", { scope: "col" }, t(`trial.${name}`))));
  const cell = (row, name) => h("td", {}, (name === "now" ? row.value : row[name]) ?? t("trial.none"));
  const body = rows.map((row) => h("tr", {}, h("th", { scope: "row" }, row.label), shown.map((name) => cell(row, name))));
  const size = (what, value) => (value > 0 && FLEXION.test(what) ? `${Math.round(value)}°` : valueWords(what, value));
  const far = ({ finger, what, value }) => h("div", {}, h("dt", {}, t(`finger.${finger}`)), h("dd", {}, size(what, value)));
  const furthest = fingers.map(far);
  return h(
    "div",
    {},
    rows.length > 0 && h("table", { class: "compact" }, h("thead", {}, head), h("tbody", {}, body)),
    furthest.length > 0 && h("h3", {}, t("trial.fingers", { joint: jointName(fingers[0].what) })),
    furthest.length > 0 && h("dl", { class: "furthest" }, furthest),
  );
}

function drawCurves(root, { t: times, curves, curve, marks, onset }) {
  const place = h("div", {});
  const every = curves.map(({ what }) => what);
  const heading = every.length > 1 ? sameJointWords(curve) : curveWords(curve);
  const within = (moment) => moment - onset; // so that seconds with a tick are whole
  root.append(
    h("h3", {}, heading),
    h("div", { class: "plot-box" }, place),
    every.length > 1 ? legend(every.map((what) => distinctWords(what, every))) : "",
  );
  const plot = makePlot(place, {
    label: t("trial.curve", { curve: heading }),
    lines: every.map((_, k) => LINES[k % LINES.length]),
    words: (value) => valueWords(curve, value),
    xWords: (at) => t("trial.seconds", { at }),
    axis: 120,
    widens: true,
    under: (drawn) => drawMarks(drawn, marks.map(within)),
  });
  plot.set([times.map(within), ...curves.map(({ values }) => values)]);
  return plot;
}

/** A line where a tap closed, or a movement reached its end. */
function drawMarks(drawn, marks) {
  const { ctx, bbox } = drawn;
  ctx.save();
  ctx.strokeStyle = colour("--curve-mark");
  ctx.lineWidth = 1;
  for (const at of marks) {
    const x = drawn.valToPos(at, "x", true);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
}
