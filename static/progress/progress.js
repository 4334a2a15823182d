/** How a patient's figures went over the sessions: small plots with the band of measurement error, the other hand beside them. */
import { h } from "../dom.js";
import { errorBox, select } from "../forms.js";
import { known, t } from "../words/words.js";
import { drawSmall } from "./small.js";
import { changeWords, judged, labelWords, partOf } from "./figure_words.js";

export function mount(root, api, { record }) {
  const box = errorBox();
  const body = h("div", {}, h("p", { class: "soft" }, t("loading")));
  const [head, summary, plots, foot] = ["div", "div", "div", "div"].map((tag) => h(tag, {}));
  let leave = [];
  let gone = false;
  root.append(h("h2", {}, t("course.title")), body, box.element);
  Promise.all([api.get(`/api/patients/${record.now.id}/progress`), api.titles().catch(() => new Map())]).then(
    ([payload, titles]) => gone || begin(payload, titles),
    (error) => gone || (body.replaceChildren(), box.show(error)),
  );

  function begin(payload, titles) {
    const repeated = (hand) => payload.series.some((series) => (series.hands[hand]?.points.length ?? 0) > 1);
    const hands = Object.keys(payload.sessions).filter(repeated);
    if (!hands.length) {
      body.replaceChildren(h("p", { class: "empty" }, h("strong", {}, t("course.empty")), t("course.empty.next")));
      return;
    }
    const first = (hand) => (hand === payload.affected ? 1 : 0);
    hands.sort((a, b) => first(b) - first(a) || payload.sessions[b].length - payload.sessions[a].length);
    const chosen = { hand: hands[0], against: "first", task: null, part: null };
    const change = (more) => {
      Object.assign(chosen, more);
      draw(payload, titles, chosen, change, hands);
    };
    body.replaceChildren(head, summary, plots, foot);
    change({});
  }

  function draw(payload, titles, chosen, change, hands) {
    const all = payload.series.filter((series) => (series.hands[chosen.hand]?.points.length ?? 0) > 1);
    const beyond = all.filter((series) => judged(series, chosen).beyond);
    const tasks = [...new Set(all.map((series) => series.task))];
    if (!tasks.includes(chosen.task)) Object.assign(chosen, { task: beyond[0]?.task ?? tasks[0], part: null });
    const ofTask = all.filter((series) => series.task === chosen.task);
    const parts = [...new Set(ofTask.map(partOf))];
    if (!parts.includes(chosen.part)) chosen.part = beyond.find((series) => series.task === chosen.task && partOf(series)) ?? null;
    if (chosen.part?.task) chosen.part = partOf(chosen.part);
    chosen.part ??= parts.includes("index") ? "index" : parts[0];
    head.replaceChildren(choices(chosen, change, hands, tasks, parts, titles));
    summary.replaceChildren(...summed(all, beyond, chosen, change, titles));
    leave.forEach((unmount) => unmount());
    plots.className = "multiples";
    plots.replaceChildren();
    leave = ofTask.filter((series) => partOf(series) === chosen.part).map((series) => drawSmall(plots, payload, series, chosen));
    foot.replaceChildren(...legend(payload, chosen), ...sources(payload, ofTask, chosen));
  }

  return () => {
    gone = true;
    leave.forEach((unmount) => unmount());
  };
}

function choices(chosen, change, hands, tasks, parts, titles) {
  const one = (name, rows) => {
    const choice = select(rows, chosen[name], { "aria-label": t(`course.${name}`), onchange: () => change({ [name]: choice.value }) });
    return rows.length > 1 && choice;
  };
  return h(
    "div",
    { class: "course-head" },
    one("hand", hands.map((hand) => [hand, t(`hand.${hand}.title`)])), // prettier-ignore
    one("task", tasks.map((task) => [task, titles.get(task) ?? task.replaceAll("_", " ")])), // prettier-ignore
    one("part", parts.map((part) => [part, known(`finger.${part}`, t("course.part.all"))])), // prettier-ignore
    one("against", ["first", "before"].map((way) => [way, t(`course.against.${way}`)])), // prettier-ignore
  );
}

/** What is beyond measurement error, wherever it is; a press shows it. */
function summed(all, beyond, chosen, change, titles) {
  const count = all.filter((series) => judged(series, chosen).beyond !== null).length;
  if (!beyond.length) return [h("p", { class: "verdict" }, t(count ? "course.none" : "course.unjudged", { count }))];
  const rows = beyond.map((series) => {
    const what = { task: titles.get(series.task) ?? series.task, figure: labelWords(series), change: changeWords(series, chosen) };
    const show = () => change({ task: series.task, part: partOf(series) });
    return h("li", {}, h("button", { class: "plain", onclick: show }, t("course.beyond.row", what)));
  });
  return [
    h("p", { class: "verdict" }, t("course.beyond", { count: beyond.length, all: count })),
    h("ul", { class: "beyond-list" }, rows),
  ];
}

function legend(payload, chosen) {
  const other = Object.keys(payload.sessions).find((hand) => hand !== chosen.hand);
  const row = (kind, words) => h("li", {}, h("span", { class: `key key-${kind}`, "aria-hidden": "true" }), words);
  return [
    h(
      "ul",
      { class: "legend" },
      row("own", t(`hand.${chosen.hand}.title`)),
      other && row("other", t("course.other", { hand: t(`hand.${other}.title`) })),
      row("band", t(`course.band.${chosen.against}`)),
      row("beyond", t("course.beyond.mark")),
      row("reference", t("course.reference")),
    ),
  ];
}

function sources(payload, shown, chosen) {
  const sentences = shown.flatMap((series) => payload.judges[series.hands[chosen.hand].judge].sources);
  const references = shown.filter((series) => series.reference).map((series) => series.reference.source);
  const named = [...new Set(references)].join(", ");
  return [
    h("p", { class: "hint" }, [...new Set(sentences)].join(" "), " ", t("course.chance")),
    named && h("p", { class: "hint" }, t("course.reference.source", { names: named })),
  ].filter(Boolean);
}
