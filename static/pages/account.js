/** The own account, and for administrators all accounts. */
import * as everyone from "../account/everyone.js";
import * as own from "../account/own.js";
import { assemble, h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { title, lacks }) {
  title(t("account.title"));
  const mine = h("section", { class: "card" });
  const all = h("section", { class: "card administrators" });
  root.append(h("div", { class: "stack" }, mine, all));
  const made = () => lacks && location.assign("/"); // now everything else opens
  return assemble(api, { made }, [[own, mine], ...(lacks ? [] : [[everyone, all]])]);
}
