/** What a person must know of the glove at a browser's port: whether it is read, and what this browser still keeps. */
import { h, whenChanged } from "../dom.js";
import { decimal, t } from "../words/words.js";
import { choose, begin, watch } from "./relay.js";

const LONG = 3000; // ms that something may wait before it is a word worth

/** `session` is the session's number; `elsewhere` says that it has a glove at some browser's port. */
export function mount(root, session, elsewhere = false) {
  const draw = whenChanged(
    (report) => words(report?.session === session ? report : null, elsewhere),
    (found) => {
      root.hidden = !found;
      const text = found && h("p", { class: found.fine ? "small soft" : "warning", role: "status" }, found.text);
      root.replaceChildren(...[text, found && action(found)].filter(Boolean));
    },
  );
  const action = ({ choosing }) => choosing && h("button", { onclick: again }, t("relay.choose"));

  async function again() {
    const which = await choose();
    if (which) begin(session, which);
  }

  return watch(draw);
}

function words(report, elsewhere) {
  if (!report) return elsewhere ? { text: t("relay.elsewhere"), fine: true } : null;
  const { port, line, login, done, kept, since } = report;
  const waits = since && Date.now() - since > LONG;
  const size = { size: decimal(kept / 1e6, 1) };
  if (done) return done === "complete" ? null : { text: t(`relay.${done}`) };
  if (port === "elsewhere") return { text: t("relay.other_page"), fine: true };
  if (!login) return { text: t("relay.login", size) };
  if (!line) return { text: t(kept ? "relay.no_line" : "relay.connecting", size), fine: !kept };
  if (port === "missing" || port === "away") return { text: t("relay.no_port"), choosing: true };
  return { text: waits ? t("relay.catching_up", size) : t("relay.fine"), fine: true };
}
