/** Many figures, folded away, with a search by their names. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

/** `words` stand on the fold; `shown` is the table or what it scrolls in, in which rows are looked for. */
export function folded(words, shown, ...more) {
  const rows = [...shown.querySelectorAll("tbody tr")];
  const show = (sought) => {
    rows.forEach((row) => (row.hidden = !row.textContent.toLowerCase().includes(sought)));
    shown.querySelectorAll("details").forEach((inner) => (inner.open = sought !== "")); // what is found there is seen
  };
  const search = h("input", {
    type: "search",
    "aria-label": t("measures.search"),
    placeholder: t("measures.search"),
    oninput: () => show(search.value.trim().toLowerCase()),
  });
  return h("details", {}, h("summary", {}, words), search, shown, more);
}
