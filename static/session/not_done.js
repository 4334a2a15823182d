/** Tasks that were not done, at the top: that a patient could not is a finding, too. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { result }) {
  const row = ([title, ...why]) => h("li", {}, h("strong", {}, title), ": ", why.filter(Boolean).join(", "));
  root.append(h("h2", {}, t("not_done")), h("ul", {}, result.readings.not_done.map(row)));
  return () => {};
}
