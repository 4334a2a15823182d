/** A station: the 3-D scene, and beside it what leads a live session or plays a replay. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { follow } from "../station/connection.js";
import * as views from "../station/views.js";
import { t } from "../words/words.js";

export function mount(root, api, { id, go, title }) {
  const station = follow(id, api);
  const box = errorBox();
  const line = h("p", { class: "line warning", role: "status", hidden: true }, t("station.line_lost"));
  const panel = h("div", { class: "panel" });
  const hand = h("iframe", { src: `/scene/#${id}`, title: t("station.scene") }); // at once, as it is what takes longest
  const scene = h("div", { class: "scene" }, hand);
  const strip = h("div", { class: "strip" });
  let leave = () => {};
  let gone = false;
  document.body.classList.add("station");
  station.on("line", (stands) => (line.hidden = stands));
  station.on("ended", (latest) =>
    latest ? go(`/sessions/${latest.session}${latest.result ? `?result=${latest.result}` : ""}`, true) : missing(null),
  );

  function missing(error) {
    if (gone) return;
    document.body.classList.remove("station");
    title(t("station.closed"));
    root.replaceChildren(
      h(
        "div",
        { class: "card" },
        h("h1", {}, t("station.closed")),
        error && error.status !== 404 ? h("p", { class: "error" }, error.message) : h("p", {}, t("station.closed.next")),
        h("a", { class: "button primary", href: "/" }, t("patients.back")),
      ),
    );
  }

  async function begin() {
    await station.begin();
    if (gone) return;
    /** @type {[any, { mount: (...given: any[]) => () => void }]} */
    const [session, kind] = await Promise.all([
      api.get(`/api/sessions/${station.latest.session}`),
      station.latest.replay ? import("../station/replay.js") : import("../station/live.js"),
    ]);
    if (gone) return;
    title(t(station.latest.replay ? "replay.title" : "station.title", { patient: session.patient.pseudonym }));
    const sides = h("div", { class: "views" });
    scene.append(sides);
    const parts = [kind.mount(panel, api, { station, session, scene, strip, go }), views.mount(sides, api, { station, scene })];
    leave = () => parts.forEach((unmount) => unmount());
  }

  root.append(h("div", { class: "workplace" }, h("div", { class: "view" }, line, scene, strip), panel), box.element);
  begin().catch(missing);
  return () => {
    gone = true;
    leave();
    station.leave();
  };
}
