/** The goals that were set for this hand, beside what was measured. */
import { h } from "../dom.js";
import { labelled } from "../words/joined.js";
import { t } from "../words/words.js";

export function mount(root, api, { result }) {
  root.hidden = !result.goals.length;
  const rows = result.goals.map(([name, value, range, reached]) =>
    h("li", {}, labelled(name, ""), h("strong", {}, value), h("br"), h("span", { class: "soft" }, t("goals.row", { range, reached }))),
  );
  root.append(h("h2", {}, t("goals.title")), h("ul", { class: "notes" }, rows));
  return () => {};
}
