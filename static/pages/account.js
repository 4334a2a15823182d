/** The own account, and for administrators all accounts. */
import * as everyone from "../account/everyone.js";
import * as own from "../account/own.js";
import * as wards from "../account/wards.js";
import { assemble, h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { title, lacks, roles }) {
  title(t("account.title"));
  const mine = h("section", { class: "card" });
  const all = h("section", { class: "card administrators" });
  const parts = h("section", { class: "card administrators" });
  root.append(h("div", { class: "stack" }, mine, all, parts));
  const made = () => lacks && location.assign("/"); // now everything else opens
  const leave = assemble(api, { made }, [[own, mine]]);
  const manages = roles.includes("administrator") && !lacks;
  const people = manages ? everyone.mount(all, api) : null;
  const leaveWards = manages ? wards.mount(parts, api, { changed: (now) => people.draw(now) }) : () => {};
  return () => [leave, people?.leave ?? (() => {}), leaveWards].forEach((one) => one());
}
