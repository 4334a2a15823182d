/** What was done before: the patient's sessions, the newest first, with their calibration and whatever needs a look. */
import { h } from "../dom.js";
import { closing } from "./unfinished.js";
import { clock, counted, dayAndTime, t } from "../words/words.js";

const NEWEST = 5; // shown at first
const KIND = { processed: "good", failed: "bad", open: "warn" };

export function mount(root, api, { record, go }) {
  const list = h("div", {});
  root.append(h("h2", {}, t("visits.title")), list);
  let gone = false;
  api.titles().then(
    (titles) => gone || draw(titles),
    () => gone || draw(new Map()),
  );

  function draw(titles, all = false) {
    const sessions = record.now.sessions;
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
      ...(shown.length < sessions.length ? [more(titles, shown.length)] : []),
    );
  }

  /** A press shows all, and goes on where the list ended. */
  function more(titles, from) {
    const show = () => {
      draw(titles, true);
      list.querySelectorAll("li > a")[from].focus();
    };
    return h("button", { onclick: show }, counted("visits.all", record.now.sessions.length));
  }

  return () => {
    gone = true;
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
