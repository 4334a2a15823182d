/** Sessions that run or that somebody forgot to finish: said above the list of patients, with what to do. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api) {
  let gone = false;
  const draw = () =>
    api.get("/api/sessions/unfinished").then(
      (sessions) => gone || root.replaceChildren(...sessions.map((session) => one(api, session, draw))),
      () => {}, // the list below says what is wrong
    );
  draw();
  return () => {
    gone = true;
  };
}

/** The button that finishes a session where it stands, and what goes wrong with that. */
export function closing(api, session, done) {
  const box = errorBox();
  const finish = () => api.post(`/api/sessions/${session.id}/closing`).then(done);
  const button = h("button", { type: "button", onclick: () => once(button, box, finish) }, t("unfinished.finish"));
  return h("div", { class: "buttons above" }, button, box.element);
}

function one(api, session, done) {
  const who = { patient: session.patient.pseudonym, since: dayAndTime(session.started) };
  const words = t(session.overnight ? "unfinished.overnight" : "unfinished.runs", who);
  const address = session.station ? `/stations/${session.station}` : `/sessions/${session.id}`;
  const open = h("a", { class: "button", href: address }, t("unfinished.open"));
  return h(
    "div",
    { class: session.overnight ? "warning" : "note" },
    h("p", {}, words),
    h("div", { class: "buttons" }, open, session.overnight && closing(api, session, done)),
  );
}
