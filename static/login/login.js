/** Ask for the one-time code and log in with it; where accounts have passwords, for those first. */
import { preferences } from "../preferences.js";
import { language } from "../words/languages.js";
import { t } from "../words/words.js";
import * as password from "./password.js";
import * as second from "./second.js";

function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** @type {HTMLLinkElement} */
const { href: FAVICON } = document.querySelector("link[rel=icon]");
const REFUSED = {
  refused: "login.single_refused",
  late: "login.single_late",
  role: "login.single_role",
  away: "login.single_away",
}; // why the organisation's login let nobody in

export function mount(root) {
  const alert = make("div", { role: "alert" });
  const input = make("input", { id: "code", autocomplete: "off", spellcheck: "false", "aria-describedby": "hint", name: "code" });
  const button = make("button", { class: "primary large", type: "submit" }, t("login.send"));
  const form = make(
    "form",
    { novalidate: "" },
    make(
      "div",
      { class: "field" },
      make("label", { for: "code" }, t("login.code")),
      input,
      make("p", { class: "hint", id: "hint" }, t("login.hint")),
    ),
    button,
  );
  const say = (text) => alert.replaceChildren(make("p", { class: "error" }, text));

  async function logIn(event) {
    event.preventDefault();
    const token = codeOf(input.value);
    if (!token) return say(t("login.missing"));
    button.disabled = true;
    const refusal = await enter({ token });
    if (!refusal) return undefined;
    button.disabled = false;
    say(refusal);
    return input.focus();
  }

  /** Log in, or go on to the second step; gives the sentence where it was refused. */
  async function enter(proof) {
    const { refusal, answer } = await post("/api/login", proof);
    if (answer?.ticket) goOn(answer.ticket);
    else if (!refusal) location.assign("/");
    return refusal;
  }

  function goOn(ticket) {
    alert.replaceChildren();
    second.mount(steps, { make, post, say, ticket });
  }

  form.addEventListener("submit", logIn);
  const passwords = make("div");
  const code = make(
    "details",
    { open: "" },
    make("summary", { hidden: "" }, t("login.with_code")),
    make("p", { class: "soft" }, t("login.lead")),
    form,
    make("h3", {}, t("login.where")),
    make("p", {}, t("login.where_text")),
    make("p", {}, make("code", {}, t("login.command"))),
  );
  const steps = make("div", {}, make("h2", {}, t("login.title")), passwords, code);
  root.append(
    make("div", { class: "brand" }, make("img", { src: FAVICON, alt: "" }), make("h1", {}, "Handscope")),
    make(
      "div",
      { class: "card" },
      alert,
      steps,
    ),
  );
  if (location.search.includes("token=")) say(t("login.used"));
  const refused = new URLSearchParams(location.search).get("refused");
  if (refused) say(t(REFUSED[refused] ?? REFUSED.refused));
  input.focus();
  const waiting = location.hash.match(/^#second=([\w-]+)$/)?.[1];
  if (waiting) {
    history.replaceState(null, "", "/login");
    goOn(waiting);
    return () => root.replaceChildren();
  }
  waysIn().then((ways) => {
    if (ways.passwords) withPasswords();
    if (ways.single) passwords.prepend(make("p", {}, make("a", { href: "/login/sso" }, t("login.single"))));
  });

  /** Who has begun with the code goes on with it. */
  function withPasswords() {
    const begun = input.value !== "" || button.disabled;
    code.open = begun;
    code.firstChild.hidden = false;
    password.mount(passwords, { make, enter, say, takesFocus: !begun });
  }

  return () => root.replaceChildren();
}

/** The code from what was pasted: the code itself, or an address with it. */
function codeOf(text) {
  return text.trim().match(/[?&]token=([^&\s]+)/)?.[1] ?? text.trim();
}

/** What the server asks for; a code where it does not say. */
async function waysIn() {
  return (await fetch("/api/login").catch(() => null))?.json() ?? {};
}

/** Ask the server: its `answer` where it has one, the sentence as `refusal` where it refused. */
async function post(path, body) {
  try {
    const response = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json", "Accept-Language": language },
      body: JSON.stringify(body),
    });
    const answer = response.status === 204 ? null : await response.json().catch(() => ({}));
    return response.ok ? { answer, refusal: "" } : { refusal: answer.error ?? t("login.refused") };
  } catch {
    return { refusal: t("login.unreachable") };
  }
}

const root = make("main");
document.title = `${t("login.title")} · Handscope`;
document.body.append(root, make("aside", {}, preferences()), make("footer", { class: "soft small" }, t("notice")));
mount(root);
