/** Which line is which: a stroke in the line's colour and dash, and its name. */
import { h } from "../dom.js";

export function legend(lines) {
  const rows = lines.map((line, k) => h("li", {}, h("span", { class: `stroke stroke-${k + 1}`, "aria-hidden": "true" }), line));
  return h("ul", { class: "legend" }, rows);
}
