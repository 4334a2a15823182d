/** The patient's own screen: invited by a code that is shown once, listed, ended. */
import { h } from "../dom.js";
import { errorBox, field, once, select } from "../forms.js";
import { language, LANGUAGES } from "../words/languages.js";
import { t } from "../words/words.js";

const LOOPBACK = ["127.0.0.1", "localhost", "[::1]"]; // a tablet does not reach such a server

export function mount(root, api, { station }) {
  const path = `/api/stations/${station.name}/screens`;
  const box = errorBox();
  const rows = h("ul");
  const invitation = h("div", { role: "status" });
  const wanted = select(Object.entries(LANGUAGES), language, { name: "screen-language" });
  const more = h("button", { type: "button", "data-invite": true, onclick: () => work(more, invite) }, t("screens.new"));
  const folded = h(
    "details",
    {},
    h("summary", {}, t("screens.title")),
    h("p", { class: "soft" }, t("screens.lead")),
    rows,
    field(t("screens.language"), wanted),
    more,
    invitation,
  );
  let gone = false;
  let invited = ""; // the screen whose code is shown

  async function list() {
    const every = await api.get(path);
    if (!gone) rows.replaceChildren(...every.map(row));
  }

  function row(screen) {
    const ending = h("button", { type: "button", class: "plain", onclick: () => work(ending, () => end(screen)) }, t("screens.end"));
    const words = t(screen.open ? "screens.open" : "screens.invited", { ...screen, language: LANGUAGES[screen.language] });
    return h("li", {}, words, " ", ending);
  }

  async function invite() {
    const { screen, code, path: page, minutes } = await api.post(path, { language: wanted.value });
    const address = `${location.origin}${page}`;
    const shown = [
      h("p", {}, t("screens.once", { minutes })),
      h("p", { class: "code", "data-code": code }, code),
      h("p", {}, t("screens.type", { address: `${location.host}${page.split("?")[0]}` })),
      LOOPBACK.includes(location.hostname) && h("p", { class: "warning" }, t("screens.loopback")),
      h("p", {}, h("a", { href: address, target: "_blank", rel: "noopener" }, t("screens.here"))),
    ];
    invitation.replaceChildren(...shown.filter(Boolean));
    invited = screen;
  }

  async function end({ screen }) {
    await api.remove(`${path}/${screen}`);
    if (screen === invited) invitation.replaceChildren();
  }

  const work = (button, task) => once(button, box, () => task().then(list));
  folded.addEventListener("toggle", () => folded.open && list().catch((error) => gone || box.show(error)));
  root.append(folded, box.element);
  return () => (gone = true);
}
