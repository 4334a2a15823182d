/** Name and password, where accounts have one. */
import { t } from "../words/words.js";

export function mount(root, { make, enter, say, takesFocus }) {
  const name = make("input", { id: "name", name: "username", autocomplete: "username", spellcheck: "false", autocapitalize: "none" });
  const password = make("input", { id: "password", name: "password", type: "password", autocomplete: "current-password" });
  const button = make("button", { class: "primary large", type: "submit" }, t("login.send"));
  const labelled = (word, input) => make("div", { class: "field" }, make("label", { for: input.id }, t(word)), input);
  const form = make("form", { novalidate: "" }, labelled("login.name", name), labelled("login.password", password), button);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (!name.value.trim() || !password.value) return say(t("login.missing_name"));
    button.disabled = true;
    const refusal = await enter({ name: name.value.trim(), password: password.value });
    if (!refusal) return undefined;
    button.disabled = false;
    say(refusal);
    password.select();
    return password.focus();
  });
  root.append(form);
  if (takesFocus) name.focus();
  return () => form.remove();
}
