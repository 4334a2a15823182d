/** What was erased for good, below the archive: when, and how much; never whose it was. */
import { h } from "../dom.js";
import { counted, day, t } from "../words/words.js";

export function mount(root, api) {
  let gone = false;
  api.get("/api/erasures").then(
    (lines) => gone || (lines.length && root.replaceChildren(h("h2", {}, t("erasures.title")), h("ul", { class: "soft" }, lines.map(one)))),
    () => {}, // the list above says what is wrong
  );
  return () => {
    gone = true;
  };
}

function one({ at, counts }) {
  return h("li", {}, t("erasures.row", { day: day(at), sessions: counted("sessions", counts.sessions) }));
}
