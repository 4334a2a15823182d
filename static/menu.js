/** The menu at the end of the header: language, brightness and logging out. */
import { h, icon } from "./dom.js";
import { preferences } from "./preferences.js";
import { t } from "./words/words.js";

export function menu(logOut) {
  const opener = h("summary", {}, icon("menu"), h("span", { class: "words" }, t("nav.menu")));
  const protocols = h("a", { class: "button clinicians", href: "/protocols", onclick: () => close() }, t("protocols.title"));
  const devices = h("a", { class: "button clinicians", href: "/devices", onclick: () => close() }, t("devices.title"));
  const root = h(
    "details",
    { class: "menu" },
    opener,
    h("div", { class: "card" }, preferences(), protocols, devices, h("button", { onclick: logOut }, t("nav.logout"))),
  );
  document.addEventListener("click", (event) => root.contains(event.target) || close());
  root.addEventListener("keydown", (event) => event.key === "Escape" && (close(), opener.focus()));

  function close() {
    root.open = false;
  }
  return root;
}
