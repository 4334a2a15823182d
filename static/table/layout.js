/** How the text of a table is laid out; with each change the table is read anew. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";

const DELIMITERS = [
  [";", "semicolon"],
  [",", "comma"],
  ["\t", "tab"],
  ["|", "bar"],
  [" ", "space"],
];

/** @param {import("../types/api.d.ts").TableAnswer} seen */
export function make(seen, read) {
  const { delimiter, decimal, header, skip } = seen.layout;
  const between = select(
    DELIMITERS.map(([sign, name]) => [sign, t(`table.delimiter.${name}`)]),
    delimiter,
  );
  const point = select(
    [
      [".", t("table.decimal.point")],
      [",", t("table.decimal.comma")],
    ],
    decimal,
  );
  const first = select(
    [
      ["true", t("table.header.yes")],
      ["false", t("table.header.no")],
    ],
    String(header),
  );
  const above = h("input", { type: "number", min: 0, max: 10000, value: String(skip), inputmode: "numeric" });
  const fields = h(
    "div",
    { class: "options" },
    field(t("table.delimiter"), between),
    field(t("table.decimal"), point),
    field(t("table.header"), first),
    field(t("table.skip"), above),
  );
  fields.addEventListener("change", () =>
    read({ delimiter: between.value, decimal: point.value, header: first.value, skip: above.value || "0" }),
  );
  return h("details", { open: Boolean(seen.problem) }, h("summary", {}, t("table.layout")), fields);
}
