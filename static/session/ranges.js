/** Range of motion in words, joint by joint; the words are the report's. */
import { h } from "../dom.js";
import { several } from "../words/joined.js";
import { known, t } from "../words/words.js";
import { changesCaption } from "./changes.js";

export function mount(root, api, { result }) {
  const tables = result.readings.ranges;
  root.append(...tables.map((payload, k) => section(payload, result.readings.changes, k > 0 && !payload.full)));
  if (!tables.length && !result.readings.tapping.length && !result.readings.others.length)
    root.append(h("div", { class: "card" }, h("p", { class: "empty" }, h("strong", {}, t("ranges.empty")), t("ranges.empty.next"))));
  return () => {};
}

/** Of a task that did not ask for the full range it is folded away below the first. */
function section(payload, changes, folded) {
  const title = t(payload.full ? "ranges.title" : "ranges.reached");
  const tasks = several(payload.tasks);
  const heading = [h("h2", {}, title), h("p", { class: "soft" }, tasks)];
  if (!payload.rows.length) return h("div", { class: "card" }, heading, h("p", { class: "warning" }, t("ranges.nothing")));
  const columns = ["ranges.joint", "ranges.flexion", "ranges.extension", "ranges.sideways", "ranges.signal"].map((word) =>
    h("th", { scope: "col" }, t(word)),
  );
  const rows = h("table", { class: "ranges joint-ranges" }, h("thead", {}, h("tr", {}, columns)), groups(payload.rows).map(body));
  const table = h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": title }, rows);
  const compared = payload.rows.some((row) => Object.values(row.changes).some(Boolean));
  const captions = [h("p", { class: "hint" }, t("ranges.caption")), compared && changesCaption(changes, "range_of_motion")];
  if (folded) return h("details", { class: "card" }, h("summary", {}, h("h2", {}, t("ranges.of", { title, tasks }))), table, captions);
  return h("div", { class: "card" }, heading, table, captions);
}

/** Rows by part of the hand, in order. */
function groups(rows) {
  const byGroup = new Map();
  rows.forEach((row) => byGroup.set(row.group, [...(byGroup.get(row.group) ?? []), row]));
  return [...byGroup.values()];
}

function body(rows) {
  return h("tbody", {}, rows.map(line));
}

function line(row) {
  const grade = h("span", { class: `badge ${row.grade}` }, known(`grade.${row.grade}`, row.grade));
  return h(
    "tr",
    {},
    h("th", { scope: "row" }, `${row.group} ${row.joint}`.trim()),
    ["flexion", "extension", "sideways"].map((cell) => {
      const about = { class: `number ${cell} ${row[cell] ? "" : "none"}`, "data-column": t(`ranges.${cell}`) };
      return h("td", about, row[cell] || "–", row.changes[cell] && h("div", { class: "change" }, row.changes[cell]));
    }),
    h("td", {}, grade, row.grade !== "good" && row.reasons.length > 0 && h("div", { class: "hint" }, several(row.reasons))),
  );
}
