/** The second step of a login: a code of an app or a recovery code, or a passkey. */
import { t } from "../words/words.js";
import * as passkey from "./passkey.js";

export function mount(root, { make, post, say, ticket }) {
  const typed = { autocomplete: "one-time-code", spellcheck: "false", autocapitalize: "none" };
  const input = make("input", { id: "second", "aria-describedby": "second-hint", ...typed });
  const button = make("button", { class: "primary large", type: "submit" }, t("login.send"));
  const field = make(
    "div",
    { class: "field" },
    make("label", { for: "second" }, t("login.second_code")),
    input,
    make("p", { class: "hint", id: "second-hint" }, t("login.second_hint")),
  );
  const form = make("form", { novalidate: "" }, field, button);
  const other = make("p");
  root.replaceChildren(make("h2", {}, t("login.second")), form, other, make("p", {}, make("a", { href: "/login" }, t("login.again"))));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (!input.value.trim()) return say(t("login.second_missing"));
    return enter({ code: input.value.trim() }, button, input);
  });
  input.focus();
  offerPasskey();

  async function enter(proof, by, next) {
    by.disabled = true;
    const { refusal } = await post("/api/login/second", { ticket, ...proof });
    if (!refusal) return location.assign("/");
    by.disabled = false;
    say(refusal);
    return next.focus();
  }

  /** A passkey, where the account has one for this address. */
  async function offerPasskey() {
    const { answer, refusal } = await post("/api/login/second-factors", { ticket });
    if (refusal) return say(refusal);
    ticket = answer.ticket;
    if (!answer.passkey || !passkey.offered()) return undefined;
    const use = make("button", { type: "button", class: "large" }, t("login.passkey"));
    use.addEventListener("click", async () => {
      const credential = await passkey.prove(answer.passkey).catch(() => null);
      return credential ? enter({ credential }, use, use) : say(t("login.passkey_failed"));
    });
    return other.replaceChildren(use);
  }

  return () => root.replaceChildren();
}
