/** How a patient's figures went over the sessions: small plots with the band of measurement error, the other hand beside them. */
import { h } from "../dom.js";
import { errorBox, select } from "../forms.js";
import { language } from "../words/languages.js";
import { counted, known, t } from "../words/words.js";
import { handsOf, hasCourse } from "./glance.js";
import { legend, sources } from "./legend.js";
import { drawSmall } from "./small.js";
import { changeWords, judged, labelWords, partOf, PARTS } from "./figure_words.js";
import { drawTreatment } from "./treatment.js";

export function mount(root, api, { record, course, treats }) {
  const box = errorBox();
  const body = h("div", {}, h("p", { class: "soft" }, t("loading")));
  const [head, summary, plots, foot] = ["div", "div", "div", "div"].map((tag) => h(tag, {}));
  const treated = h("section", { class: "treatment" });
  const chosen = { hand: null, against: "first", view: null };
  let leave = [];
  let gone = false;
  const title = h("h2", { tabindex: "-1" }, t("course.title"));
  root.append(title, body, treated, box.element);
  course.first.then(([payload, titles]) => gone || begin(payload, titles), failed);
  const stop = course.watch(() => {
    root.scrollIntoView();
    title.focus({ preventScroll: true });
  });

  function failed(error) {
    if (!gone) body.replaceChildren();
    if (!gone) box.show(error);
  }

  async function again(titles) {
    const payload = await course.again();
    if (!gone) begin(payload, titles);
  }

  function begin(payload, titles) {
    drawTreatment(treated, api, { patient: record.now.id, events: payload.treatment_events, treats, reload: () => again(titles) });
    const hands = handsOf(payload);
    if (!hands.length) {
      body.replaceChildren(h("p", { class: "empty" }, h("strong", {}, t("course.empty")), t("course.empty.next")));
      return;
    }
    chosen.hand ??= hands[0];
    const change = (more) => {
      Object.assign(chosen, more);
      draw(payload, titles, change, hands);
    };
    body.replaceChildren(head, summary, plots, foot);
    change({});
  }

  function draw(payload, titles, change, hands) {
    const all = payload.series.filter((series) => hasCourse(series, chosen.hand));
    const beyond = all.filter((series) => judged(series, chosen).beyond);
    const views = viewsOf(all);
    if (!views.includes(chosen.view)) chosen.view = views.includes(FIRST) || !beyond.length ? views[0] : partOf(beyond[0]);
    const shown = all.filter((series) => isIn(series, chosen.view));
    head.replaceChildren(choices(chosen, change, hands, views), ...(treats ? [printed(record.now.id, chosen.hand)] : []));
    summary.replaceChildren(...summed(all, beyond, chosen, change, titles), ...unknownOf(all, shown, chosen));
    leave.forEach((unmount) => unmount());
    plots.className = "multiples";
    plots.replaceChildren();
    const aim = treats && { api, patient: record.now.id, reload: () => again(titles) };
    const titled = new Set(shown.map((series) => series.task)).size > 1;
    leave = shown.map((series) => drawSmall(plots, payload, series, chosen, { aim, task: titled && (titles.get(series.task) ?? "") }));
    foot.replaceChildren(...legend(payload, chosen, shown), ...sources(payload, shown, chosen));
  }

  return () => {
    gone = true;
    stop();
    leave.forEach((unmount) => unmount());
  };
}

/** The report to be printed opens beside the page. */
function printed(patient, hand) {
  const href = `/api/patients/${patient}/progress.pdf?hand=${hand}&language=${language}`;
  return h("p", {}, h("a", { href, target: "_blank", rel: "noopener" }, t("course.report")));
}

const FIRST = "important";
const SHOWN = 4; // changed figures that need no press
const isIn = (series, view) => (view === FIRST ? series.important : partOf(series) === view);

/** The important figures, then each finger's whole history over all tasks, then what is of no finger. */
function viewsOf(all) {
  const parts = [...new Set(all.map(partOf))].sort((a, b) => PARTS.indexOf(a) - PARTS.indexOf(b));
  return [...(all.some((series) => series.important) ? [FIRST] : []), ...parts];
}

function choices(chosen, change, hands, views) {
  const one = (name, rows) => {
    const choice = select(rows, chosen[name], { "aria-label": t(`course.${name}`), onchange: () => change({ [name]: choice.value }) });
    return rows.length > 1 && choice;
  };
  return h(
    "div",
    { class: "course-head" },
    one("hand", hands.map((hand) => [hand, t(`hand.${hand}.title`)])), // prettier-ignore
    one("view", views.map((view) => [view, known(`course.view.${view}`, known(`finger.${view}`, view))])), // prettier-ignore
    one("against", ["first", "before"].map((way) => [way, t(`course.against.${way}`)])), // prettier-ignore
  );
}

/** How many of the figures shown cannot be judged, where others are. */
function unknownOf(all, shown, chosen) {
  const unknown = (series) => judged(series, chosen).beyond === null;
  const count = shown.filter(unknown).length;
  return count && !all.every(unknown) ? [h("p", { class: "soft" }, counted("course.unknown", count, { all: shown.length }))] : [];
}

/** What is beyond measurement error, wherever it is; a press shows it. */
function summed(all, beyond, chosen, change, titles) {
  const count = all.filter((series) => judged(series, chosen).beyond !== null).length;
  if (!beyond.length) return [h("p", { class: "verdict" }, count ? counted("course.none", count) : t("course.unjudged"))];
  const rows = beyond.map((series) => {
    const what = { task: titles.get(series.task) ?? series.task, figure: labelWords(series), change: changeWords(series, chosen) };
    const show = () => change({ view: partOf(series) });
    return h("li", {}, h("button", { class: "plain", onclick: show }, t("course.beyond.row", what)));
  });
  const list = (some) => h("ul", { class: "beyond-list" }, some);
  const more = rows.length > SHOWN + 1 ? rows.splice(SHOWN) : []; // one alone needs no fold
  return [
    h("p", { class: "verdict" }, counted("figures_beyond", beyond.length, { all: count })),
    list(rows),
    more.length > 0 && h("details", {}, h("summary", {}, counted("more_changes", more.length)), list(more)),
  ].filter(Boolean);
}
