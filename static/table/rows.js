/** The first rows of a table, as they are written. */
import { h } from "../dom.js";
import { counted, t } from "../words/words.js";

/** @param {import("../types/api.d.ts").TableAnswer} seen */
export function make(seen) {
  const width = Math.max(0, ...seen.rows.map((row) => row.length));
  const names = seen.names.length ? seen.names : Array.from({ length: width }, (_, k) => String(k));
  const table = h(
    "table",
    { class: "first-rows" },
    h("thead", {}, h("tr", {}, names.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, seen.rows.map((row) => h("tr", {}, row.map((cell) => h("td", {}, cell))))),
  );
  const size = counted("table.size", seen.count, { columns: counted("columns", seen.columns) });
  return [
    h("p", { class: "soft" }, seen.problem ? t("table.unread") : size),
    seen.problem && h("p", { class: "error", role: "alert" }, seen.problem),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": t("table.first_rows") }, table),
  ];
}
