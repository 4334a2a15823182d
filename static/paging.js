/** Where we are in a long list, and how to go on. */
import { h } from "./dom.js";
import { t, whole } from "./words/words.js";

/** Of `found`, the `rows` from `offset` on and how many there are in all, as pages of `size`; nothing where one page shows all. */
export function pages({ rows, total }, offset, size, turn) {
  if (total <= size) return h("span", {});
  const step = (word, to) => h("button", { type: "button", onclick: () => turn(to), disabled: to < 0 || to >= total }, t(word));
  const where = t("list.found", { from: whole(offset + 1), to: whole(offset + rows.length), total: whole(total) });
  return h(
    "nav",
    { class: "pages", "aria-label": t("list.pages") },
    step("list.newer", offset - size),
    h("span", { role: "status" }, where),
    step("list.older", offset + size),
  );
}
