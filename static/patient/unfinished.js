/** Sessions that run or that somebody forgot to finish: said above the list of patients and on the patient's page, with what to do. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

const REPAIR_MS = 3000; // between two looks at a repair
const ELSEWHERE_MS = 15000; // at what another server records

/** Of one patient, or of all; gives what ends it, and when it has said so for the first time. */
export function mount(root, api, patient = null) {
  let gone = false;
  let timer = 0;
  const show = (all) => {
    if (gone) return;
    const sessions = all.filter((session) => patient === null || session.patient.id === patient);
    root.replaceChildren(...sessions.map((session) => one(api, session, draw)));
    if (sessions.some((session) => session.repairing || session.reading)) again(REPAIR_MS);
    else if (sessions.some((session) => session.elsewhere)) again(ELSEWHERE_MS);
  };
  const again = (wait) => {
    clearTimeout(timer);
    timer = gone ? 0 : setTimeout(draw, wait);
  };
  const draw = () => api.get("/api/sessions/unfinished").then(show, () => again(ELSEWHERE_MS)); // the list below says what is wrong
  const leave = () => {
    gone = true;
    clearTimeout(timer);
  };
  return { leave, said: draw() };
}

/** The button that finishes a session where it stands, and what goes wrong with that. */
export function closing(api, session, done) {
  const box = errorBox();
  const finish = () => api.post(`/api/sessions/${session.id}/closing`).then(done);
  const button = h("button", { type: "button", onclick: () => once(button, box, finish) }, t("unfinished.finish"));
  return h("div", { class: "buttons above" }, button, box.element);
}

/** A session that another of several servers records, with the way there. */
function elsewhere(session, who) {
  const { name, address, answers } = session.elsewhere;
  const words = t(answers ? "unfinished.elsewhere" : "unfinished.elsewhere_silent", { ...who, server: name });
  const there = answers && address && h("a", { class: "button", href: `${address}/` }, t("unfinished.go_there", { server: name }));
  return h("div", { class: answers ? "note" : "warning" }, h("p", {}, words), there && h("div", { class: "buttons" }, there));
}

function one(api, session, done) {
  const who = { patient: session.patient.pseudonym, since: dayAndTime(session.started) };
  for (const stage of ["repairing", "reading"]) {
    if (!session[stage]) continue;
    const [now, all] = session[stage];
    return h("p", { class: "note" }, t(`unfinished.${stage}`, { ...who, this: now, all }));
  }
  if (session.elsewhere) return elsewhere(session, who);
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
