/** A question before an action: a reason to skip a task, why the patient could not do it, whether to finish or stop moving early. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { counted, t } from "../words/words.js";

const NAMED = 4; // tasks left that are named; the others are counted
const REASONS = {
  skip: ["pain", "tired", "no_time", "not_needed"],
  unable: ["pain", "weakness", "stiffness", "coordination", "fatigue", "not_understood"],
};

export function mount(root, api, { act, left, lacking, send, cancel }) {
  const box = errorBox();
  const buttons = (word) =>
    h(
      "div",
      { class: "buttons-tall" },
      h("button", { class: "primary large", type: "submit" }, word),
      h("button", { class: "large", type: "button", "data-back": true, onclick: cancel }, t("go_back")),
    );
  const form = h("form", { class: "question", novalidate: true });
  if (REASONS[act]) {
    const reason = h("input", { maxlength: 1000, autocomplete: "off", name: "reason" });
    const offered = new Map(REASONS[act].map((name) => [t(`reason.${name}`), name]));
    const take = (words) => ((reason.value = words), reason.focus());
    const ready = [...offered.keys()].map((words) => h("button", { type: "button", onclick: () => take(words) }, words));
    form.append(
      field(t(`${act}.why`), reason, t("skip.hint")),
      h("div", { class: "reasons" }, ready),
      box.element,
      buttons(t(`${act}.send`)),
    );
    onSubmit(form, box, async () => {
      const words = reason.value.trim();
      if (!words) throw new Error(t("skip.missing"));
      await send(offered.get(words) ?? words); // one that is offered by its name: reports say it in their language
    });
  } else if (act === "without") {
    form.append(h("p", {}, h("strong", {}, t("without.sure"))), h("p", {}, t("without.text")), box.element, buttons(t("without.send")));
    onSubmit(form, box, () => send(""));
  } else if (act === "enough") {
    const missing = lacking.length ? t("free.more", { joints: named(lacking) }) : t("free.begins");
    form.append(h("p", {}, h("strong", {}, t("enough.sure"))), h("p", {}, missing), h("p", {}, t("enough.text")), box.element);
    const stay = h("button", { class: "primary large", type: "button", "data-back": true, onclick: cancel }, t("enough.back"));
    form.append(h("div", { class: "buttons-tall" }, stay, h("button", { class: "large", type: "submit" }, t("enough.send"))));
    onSubmit(form, box, () => send(""));
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

/** Titles of tasks in a row: the first few, and how many more. */
export function named(titles) {
  const rest = titles.length - NAMED;
  return rest > 1 ? counted("finish.more", rest, { tasks: titles.slice(0, NAMED).join(", ") }) : titles.join(", ");
}
