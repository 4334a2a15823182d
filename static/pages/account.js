/** The own account, and for administrators all accounts. */
import * as everyone from "../account/everyone.js";
import * as own from "../account/own.js";
import { assemble, h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { title }) {
  title(t("account.title"));
  const mine = h("section", { class: "card" });
  const all = h("section", { class: "card administrators" });
  root.append(h("div", { class: "stack" }, mine, all));
  return assemble(api, {}, [
    [own, mine],
    [everyone, all],
  ]);
}
