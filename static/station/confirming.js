/** A question before an action: the reason to skip a task, or whether to finish with tasks left. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { t } from "../words/words.js";

const NAMED = 4; // tasks left that are named; the others are counted
const REASONS = ["pain", "tired", "unable", "not_needed"];

export function mount(root, api, { act, left, send, cancel }) {
  const box = errorBox();
  const buttons = (word) =>
    h(
      "div",
      { class: "buttons-tall" },
      h("button", { class: "primary large", type: "submit" }, word),
      h("button", { class: "large", type: "button", onclick: cancel }, t("go_back")),
    );
  const form = h("form", { class: "question", novalidate: true });
  if (act === "skip") {
    const reason = h("input", { maxlength: 1000, autocomplete: "off", name: "reason" });
    const ready = REASONS.map((name) =>
      h("button", { type: "button", onclick: () => ((reason.value = t(`reason.${name}`)), reason.focus()) }, t(`reason.${name}`)),
    );
    form.append(field(t("skip.why"), reason, t("skip.hint")), h("div", { class: "reasons" }, ready), box.element, buttons(t("skip.send")));
    onSubmit(form, box, async () => {
      if (!reason.value.trim()) throw new Error(t("skip.missing"));
      await send(reason.value.trim());
    });
  } else {
    form.append(
      h("p", {}, h("strong", {}, t("finish.sure"))),
      h("p", {}, t("finish.left", { tasks: named(left.map((task) => task.title)) })),
      box.element,
      buttons(t("finish.send")),
    );
    onSubmit(form, box, () => send(""));
  }
  root.append(form);
  return () => form.remove();
}

function named(titles) {
  const rest = titles.length - NAMED;
  return rest > 1 ? t("finish.more", { tasks: titles.slice(0, NAMED).join(", "), count: rest }) : titles.join(", ");
}
