/** What changed since the patient's session before, folded away below the headlines: the words are the report's. */
import { h } from "../dom.js";
import { dayAndTime, t } from "../words/words.js";
import { folded } from "./folded.js";

/** Tapping: the means over the trials; ranges say it in their own table. */
export function mount(root, api, { result }) {
  const { changes } = result.readings;
  root.append(...(changes?.tapping ?? []).map((task) => section(task, changes)));
  return () => {};
}

function section(task, changes) {
  const rows = task.figures.map((figure) =>
    h("tr", {}, h("th", { scope: "row" }, figure.label), h("td", {}, figure.words)),
  );
  const heading = h("h2", {}, t("changes.title", { title: task.title, day: dayAndTime(changes.since) }));
  const table = h("table", {}, h("caption", { class: "visually-hidden" }, t("changes.tapping")), h("tbody", {}, rows));
  const captions = [h("p", { class: "hint" }, t("changes.tapping")), changesCaption(changes, "tapping")];
  return h("div", { class: "card" }, folded(heading, table, captions));
}

/** Since when, and what "beyond" and "within" are judged by. */
export function changesCaption(changes, measure) {
  return h("p", { class: "hint" }, [t("changes.caption", { day: dayAndTime(changes.since) }), ...changes.sources[measure]].join(" "));
}
