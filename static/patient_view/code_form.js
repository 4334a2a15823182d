/** Ask for the code that the therapist's screen shows. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, { open, refusal }) {
  const alert = h("div", { role: "alert" }, refusal && h("p", { class: "notice" }, refusal));
  const typing = { autocomplete: "off", autocapitalize: "characters", spellcheck: "false", maxlength: 40 };
  const input = h("input", { id: "code", name: "code", ...typing });
  const button = h("button", { class: "primary large", type: "submit" }, t("screen.code.send"));
  const say = (text) => alert.replaceChildren(h("p", { class: "error" }, text));

  async function send(event) {
    event.preventDefault();
    if (!input.value.trim()) return say(t("screen.code.missing"));
    button.disabled = true;
    const refused = await open(input.value);
    button.disabled = false;
    if (!refused) return undefined;
    say(refused);
    return input.focus();
  }

  root.className = "asking";
  root.append(
    h(
      "form",
      { class: "card", novalidate: true, onsubmit: send },
      h("h1", {}, t("screen.title")),
      alert,
      h("div", { class: "field" }, h("label", { for: "code" }, t("screen.code")), input),
      button,
    ),
  );
  input.focus();
  return () => {
    root.className = "";
  };
}
