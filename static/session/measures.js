/** All measures without a card of their own: figures by name, a column a trial, and what others measured; the words are the report's. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";
import { folded } from "./folded.js";
import * as curves from "./measure_curves.js";
import { versionOf } from "./references.js";

export function mount(root, api, { session, result, go }) {
  const address = (scheme) => new URLSearchParams({ result: result.id, ...versionOf(result), grading: scheme });
  const graded = (scheme) => go(`/sessions/${session.id}?${address(scheme)}`, true);
  const leave = result.readings.others.map((measure) => {
    const drawn = h("div", { class: "curves-of" });
    root.append(section(measure, graded, drawn));
    return curves.mount(drawn, measure);
  });
  return () => leave.forEach((unmount) => unmount());
}

function section(measure, graded, drawn) {
  const chosen = select(measure.gradings, measure.grading, { onchange: () => graded(chosen.value) });
  const normed = measure.norms.some(Boolean);
  const words = [t("measures.figure"), ...measure.trials, t("measures.unit"), normed && t("measures.norm"), t("ranges.signal")];
  const columns = words.filter(Boolean);
  const head = columns.map((word) => h("th", { scope: "col" }, word));
  const rows = measure.rows.map((row, k) => line(row, normed && (measure.norms[k] ?? {}), columns));
  const table = h("table", { class: "ranges lined" }, h("thead", {}, h("tr", {}, head)), h("tbody", {}, rows));
  return h(
    "div",
    { class: "card" },
    h("h2", {}, measure.title),
    h("p", { class: "soft" }, measure.task),
    measure.gradings.length > 0 && field(t("measures.grading"), chosen, t("measures.grading.hint")),
    measure.advice.length > 0 && doubted(measure),
    measure.fingers.length > 0 && scrolled(measure, fingers(measure)),
    measure.folded ? folded(t("measures.all", { count: rows.length }), scrolled(measure, table)) : scrolled(measure, table),
    !measure.advice.length && measure.reason && h("p", { class: "hint" }, measure.reason),
    drawn,
    measure.limit && h("p", { class: "hint" }, measure.limit),
    h("details", {}, h("summary", {}, t("measures.source")), h("p", { class: "hint" }, measure.source)),
  );
}

function scrolled(measure, table) {
  return h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": measure.title }, table);
}

/** A row a finger: what a therapist reads first. */
function fingers({ fingers }) {
  const changed = fingers.some((row) => row[4]);
  const line = ([name, ...cells]) =>
    h("tr", {}, h("th", { scope: "row" }, name), (changed ? cells : cells.slice(0, 3)).map((words) => h("td", {}, words)));
  return h("table", { class: "ranges by-finger" }, h("tbody", {}, fingers.map(line)));
}

/** Why figures cannot be trusted, and what to do about it. */
function doubted({ reason, advice }) {
  const todo = h(
    "ul",
    {},
    advice.map((words) => h("li", {}, words)),
  );
  return h("div", { class: "warning doubted" }, reason && h("p", {}, reason), h("h3", {}, t("measures.advice")), todo);
}

function line([name, values, unit, [grade, words], reason], norm, columns) {
  const signal = [h("span", { class: `badge ${grade}` }, words), reason && h("div", { class: "hint" }, reason)];
  const cells = [...values, unit, norm && (norm.told ? [norm.told, why(norm)] : ""), signal].filter((cell) => cell !== false);
  const style = (k) => (k < values.length ? "number" : cells[k] === "" ? "none" : k === values.length ? "unit" : "");
  return h(
    "tr",
    {},
    h("th", { scope: "row" }, name),
    cells.map((cell, k) => h("td", { class: style(k), "data-column": columns[k + 1] }, cell)),
  );
}

function why(norm) {
  const words = [norm.reference, norm.note].filter(Boolean).join(". ");
  return h("details", { class: "hint" }, h("summary", {}, t("measures.why")), h("p", {}, words));
}
