/** What was done before: the patient's sessions, the newest first. */
import { h } from "../dom.js";
import { clock, dayAndTime, t } from "../words/words.js";

const KIND = { processed: "good", failed: "bad", open: "warn" };

export function mount(root, api, { record }) {
  const list = h("div", {});
  root.append(h("h2", {}, t("visits.title")), list);
  let gone = false;
  api.titles().then(
    (titles) => gone || draw(titles),
    () => gone || draw(new Map()),
  );

  function draw(titles) {
    const sessions = record.now.sessions;
    if (!sessions.length)
      return list.replaceChildren(h("p", { class: "empty" }, h("strong", {}, t("visits.empty")), t("visits.empty.next")));
    return list.replaceChildren(
      h(
        "ol",
        { class: "visits" },
        sessions.map((s) => visit(s, titles)),
      ),
    );
  }

  return () => {
    gone = true;
  };
}

function visit(session, titles) {
  const tasks = [...new Set(session.tasks)].map((name) => titles.get(name) ?? name).join(", ");
  const facts = [
    t(`hand.${session.hand}.title`),
    session.duration && t("visits.length", { clock: clock(session.duration) }),
    t(`visits.source.${session.source}`),
  ];
  return h(
    "li",
    {},
    h("a", { href: `/sessions/${session.id}` }, dayAndTime(session.started)),
    h("span", { class: `badge ${KIND[session.state] ?? ""}` }, t(`session.state.${session.state}`)),
    h("span", { class: "soft" }, facts.filter(Boolean).join(" · ")),
    tasks && h("span", { class: "soft" }, tasks),
  );
}
