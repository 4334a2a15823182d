/** What self-calibration found, as tables: lengths, where and how the sensors sit, biases; each with its standard deviation. */
import { h } from "./dom.js";
import { t } from "./words/words.js";

/** From what the API tells: a summary, sentences, and three tables that open at a press; the first stands open. */
export function foundTables({ summary, words, lengths, seats, biases }) {
  return [
    h("p", {}, summary),
    words.length > 0 &&
      h(
        "div",
        { class: "warning" },
        h(
          "ul",
          {},
          words.map((sentence) => h("li", {}, sentence)),
        ),
      ),
    part("lengths", ["segment", "length", "source"], lengths, true),
    part("seats", ["segment", "along", "above", "across", "turned"], seats, false),
    part("biases", ["segment", "gyr", "acc"], biases, false),
  ];
}

function part(name, columns, rows, open) {
  if (!rows.length) return null;
  const head = columns.map((column) => h("th", { scope: "col" }, t(`found.${column}`)));
  const body = rows.map(([first, ...cells]) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, first),
      cells.map((cell) => h("td", {}, cell.replaceAll(" ± ", "\u00a0±\u00a0"))),
    ),
  );
  const table = h("table", { class: "compact" }, h("thead", {}, h("tr", {}, head)), h("tbody", {}, body));
  return h("details", { open }, h("summary", {}, t(`found.${name}`)), table);
}
