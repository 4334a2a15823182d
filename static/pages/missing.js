/** An address that is none of ours. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { title }) {
  title(t("missing.title"));
  root.append(
    h("div", { class: "head" }, h("h1", {}, t("missing.title"))),
    h("p", {}, t("missing.text")),
    h("a", { class: "button primary", href: "/" }, t("patients.back")),
  );
  return () => {};
}
