/** End the session where the wizard does not offer to finish it: what was recorded is kept. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { t } from "../words/words.js";

export function mount(root, api, { station }) {
  const box = errorBox();
  const opener = h("button", { class: "plain", onclick: () => show(true) }, t("ending.open"));
  const sure = h("button", { onclick: () => once(sure, box, station.end) }, t("ending.send"));
  const back = h("button", { onclick: () => show(false) }, t("go_back"));
  const question = h(
    "div",
    { class: "question", hidden: true },
    h("p", {}, t("ending.sure")),
    h("div", { class: "buttons" }, sure, back),
  );
  root.append(opener, question, box.element);

  function show(asked) {
    question.hidden = !asked;
    opener.hidden = asked;
    (asked ? back : opener).focus(); // Enter, pressed once too often, ends nothing
    question.scrollIntoView({ block: "nearest" });
  }

  return station.on(
    "full",
    whenChanged(
      ({ wizard, glove }) => [wizard.state === "finished" || wizard.actions.includes("finish"), glove.state === "recording_failed"],
      ([needless, last]) => {
        root.hidden = needless;
        opener.className = last ? "primary large" : "plain"; // nothing else is left to do
      },
    ),
  );
}
