/** What changed since the patient's session before, folded away below the headlines: the words are the report's. */
import { h } from "../dom.js";
import { counted, dayAndTime, t } from "../words/words.js";
import { folded } from "./folded.js";

/** Tapping: the means over the trials; ranges say it in their own table. */
export function mount(root, api, { result }) {
  const { changes } = result.readings;
  root.append(...(changes?.tapping ?? []).map((task) => section(task, changes)));
  return () => {};
}

/** What is judged, beyond measurement error first; what is not, folded again. */
function section({ title, figures }, changes) {
  const [judged, others] = [true, false].map((asked) => figures.filter((figure) => figure.judged === asked));
  const heading = h("h2", {}, t("changes.title", { title, day: dayAndTime(changes.since) }));
  const table = (rows) => h("table", {}, h("caption", { class: "visually-hidden" }, t("changes.tapping")), h("tbody", {}, rows.map(row)));
  const rest = others.length > 0 && h("details", {}, h("summary", {}, counted("changes.unjudged", others.length)), table(others));
  const captions = [h("p", { class: "hint" }, t("changes.tapping")), changesCaption(changes, "tapping")];
  return h("div", { class: "card" }, folded(heading, h("div", {}, judged.length > 0 && table(judged), rest), captions));
}

function row({ label, words, beyond }) {
  return h("tr", {}, h("th", { scope: "row" }, label), h("td", {}, beyond ? h("strong", {}, words) : words));
}

/** Since when, and what "beyond" and "within" are judged by, a sentence a line. */
export function changesCaption(changes, measure) {
  const sentences = [t("changes.caption", { day: dayAndTime(changes.since) }), ...changes.sources[measure]];
  return h("ul", { class: "hint" }, sentences.map((words) => h("li", {}, words)));
}
