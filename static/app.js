/** The one document: header and footer, and between them the page that the address names. */
import { makeApi } from "./api.js";
import { h } from "./dom.js";
import { account, forgetEarly } from "./first_view.js";
import { menu } from "./menu.js";
import { t } from "./words/words.js";

/** @type {[RegExp, () => Promise<any>][]} */
const PAGES = [
  [/^\/$/, () => import("./pages/patients.js")],
  [/^\/patients\/(\d+)$/, () => import("./pages/patient.js")],
  [/^\/patients\/(\d+\/tables\/\w+)$/, () => import("./pages/table.js")],
  [/^\/sessions\/(\d+)$/, () => import("./pages/session.js")],
  [/^\/stations\/([^/]+)$/, () => import("./pages/station.js")],
  [/^\/protocols$/, () => import("./pages/protocols.js")],
  [/^\/devices$/, () => import("./pages/devices.js")],
  [/^\/help$/, () => import("./pages/help.js")],
  [/^\/account$/, () => import("./pages/account.js")],
  [/^\/audit$/, () => import("./pages/audit.js")],
];
/** @type {[RegExp, () => Promise<any>]} */
const NONE = [/.*/, () => import("./pages/missing.js")];
/** @type {HTMLLinkElement} */
const { href: FAVICON } = document.querySelector("link[rel=icon]");
const FOR = { "/": "clinicians scientists" }; // hidden from other roles (styles/frame.css)
const api = makeApi(() => away || depart());
const { roles, lacks_second_factor: lacks } = account;
const main = h("main", { id: "main", tabindex: "-1" });
const links = [
  ["/", "nav.patients"],
  ["/help", "nav.help"],
  ["/account", "nav.account"],
].map(([href, word]) => h("a", { href, class: FOR[href] }, t(word)));
const announcement = h("p", { class: "visually-hidden", "aria-live": "polite" });
let leave = () => {};
let turn = 0;
let away = false; // the document is being left: what is refused meanwhile leads nowhere else

async function show() {
  const mine = (turn += 1);
  const [pattern, load] = PAGES.find(([address]) => address.test(location.pathname)) ?? NONE;
  if (mine > 1) forgetEarly();
  leave();
  leave = () => {};
  main.replaceChildren(h("p", { class: "soft" }, t("loading")));
  document.body.className = "";
  links.forEach((a) => (a.pathname === location.pathname ? a.setAttribute("aria-current", "page") : a.removeAttribute("aria-current")));
  const page = await load().catch(unloadable);
  if (mine !== turn || !page) return;
  main.replaceChildren();
  leave = page.mount(main, api, { id: location.pathname.match(pattern)[1], go, title, roles, lacks });
}

/** A page's module did not come: the login ended, or the server did. */
async function unloadable() {
  const reason = await api.get("/api/protocols").then(
    () => new Error(t("error.unreadable")),
    (error) => error,
  );
  main.replaceChildren(
    h("div", { class: "error", role: "alert" }, h("p", {}, reason.message), h("button", { onclick: () => location.reload() }, t("reload"))),
  );
}

/** Go to another page of ours without loading the document again. */
function go(address, replace = false) {
  history[replace ? "replaceState" : "pushState"](null, "", address);
  scrollTo(0, 0);
  return show();
}

/** Say where we are: the window's title, and to screen readers. */
function title(words) {
  document.title = `${words} · Handscope`;
  announcement.textContent = words;
}

function followed(event) {
  const link = event.target.closest("a[href]");
  const plain = event.button === 0 && !event.ctrlKey && !event.metaKey && !event.shiftKey && !event.altKey;
  if (!link || !plain || link.target || link.hasAttribute("download") || link.origin !== location.origin) return;
  if (link.pathname.startsWith("/api/") || link.getAttribute("href").startsWith("#")) return;
  event.preventDefault();
  go(link.pathname + link.search);
  main.focus({ preventScroll: true });
}

async function logOut() {
  away = true;
  const answer = await api.remove("/api/login").catch(() => null);
  depart(answer?.next);
}

function depart(address = "/login") {
  away = true;
  location.assign(address);
}

document.body.append(
  h("a", { class: "skip", href: "#main" }, t("nav.skip")),
  h(
    "header",
    { class: "top" },
    h("a", { class: "brand", href: "/" }, h("img", { src: FAVICON, alt: "" }), "Handscope"),
    h("nav", { "aria-label": t("nav.label") }, links),
    menu(logOut),
  ),
  main,
  h("footer", { class: "bottom" }, t("notice")),
  announcement,
);
/** What the account's roles do not allow is not offered; the server refuses it in any case. */
function offer() {
  document.documentElement.dataset.may = lacks ? "" : roles.join(" ");
  const seesNoPatients = roles.join() === "administrator" && location.pathname === "/";
  if ((lacks && location.pathname !== "/account") || seesNoPatients) history.replaceState(null, "", "/account");
}

document.addEventListener("click", followed);
addEventListener("popstate", show);
addEventListener("pageshow", (event) => (away &&= !event.persisted)); // who comes back to a page that the browser kept is not away
offer();
if (localStorage.getItem("handscope-relay")) import("./relay/relay.js").then((relay) => relay.resume());
show();
