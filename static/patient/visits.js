/** What was done before: the patient's sessions, the newest first, with their calibration and whatever needs a look. */
import { h, whenChanged } from "../dom.js";
import { makeComing } from "./coming.js";
import { closing } from "./unfinished.js";
import { clock, counted, dayAndTime, t } from "../words/words.js";

const NEWEST = 5; // shown at first
const KIND = { processed: "good", failed: "bad", open: "warn" };

export function mount(root, api, { record, go }) {
  const list = h("div", {});
  const course = h("button", { type: "button", onclick: () => go(location.pathname, true) }, t("coming.course"));
  const words = [h("p", {}, t("coming.all")), h("div", { class: "buttons" }, course)];
  const complete = h("div", { class: "note", role: "status", hidden: true }, words);
  const coming = makeComing(() => record.stored().then(take, () => take(seen)));
  root.append(h("h2", {}, t("visits.title")), coming.element, complete, list);
  let gone = false;
  let seen = record.now;
  let titles = new Map();
  const drawNew = whenChanged(
    (now) => [now.sessions, now.planned > 0],
    () => draw(),
  );
  api
    .titles()
    .then((found) => (titles = found))
    .catch(() => {})
    .then(() => take(seen));

  function take(now) {
    if (gone) return;
    const came = seen.planned > 0;
    seen = now;
    const comes = coming.take([{ sessions: now.sessions.length, planned: now.planned }]);
    if (came && !comes) complete.hidden = false;
    drawNew(now);
  }

  function draw(all = false) {
    const { sessions, planned } = seen;
    if (!sessions.length && planned) return list.replaceChildren();
    if (!sessions.length)
      return list.replaceChildren(h("p", { class: "empty" }, h("strong", {}, t("visits.empty")), t("visits.empty.next")));
    const shown = all ? sessions : sessions.filter((session, k) => k < NEWEST || session.state === "open");
    const finished = (session) => go(`/sessions/${session.id}`);
    return list.replaceChildren(
      h(
        "ol",
        { class: "visits" },
        shown.map((s) => visit(s, titles, s.doubts.includes("overnight") && closing(api, s, () => finished(s)))),
      ),
      ...(shown.length < sessions.length ? [more(shown.length)] : []),
    );
  }

  /** A press shows all, and goes on where the list ended. */
  function more(from) {
    const show = () => {
      draw(true);
      list.querySelectorAll("li > a")[from].focus();
    };
    return h("button", { onclick: show }, counted("visits.all", seen.sessions.length));
  }

  return () => {
    gone = true;
    coming.leave();
  };
}

/** @param {import("../types/api.d.ts").Visit} session */
function visit(session, titles, finish) {
  const tasks = [...new Set(session.tasks)].map((name) => titles.get(name) ?? name).join(", ");
  const facts = [
    t(`hand.${session.hand}.title`),
    session.duration && t("visits.length", { clock: clock(session.duration) }),
    t(`visits.source.${session.source}`),
    session.warnings && counted("warnings", session.warnings),
  ];
  const state = finish ? t("visits.unfinished") : t(`session.state.${session.state}`);
  return h(
    "li",
    {},
    h("a", { href: `/sessions/${session.id}` }, dayAndTime(session.started)),
    h("span", { class: `badge ${KIND[session.state] ?? ""}` }, state),
    h("span", { class: "soft" }, facts.filter(Boolean).join(" · ")),
    tasks && h("span", { class: "soft" }, tasks),
    session.recorded_as && h("span", { class: "soft" }, corrected(session)),
    session.doubts.map((doubt) => h("p", { class: "warning" }, t(`date.${doubt}`))),
    finish,
  );
}

const corrected = ({ recorded_as: said, date_reason: reason }) => t("dating.corrected", { said: dayAndTime(said), reason });
