/** Notes on the patient, saved when asked. */
import { h } from "../dom.js";
import { errorBox, onSubmit } from "../forms.js";
import { sendChange } from "./record.js";
import { t } from "../words/words.js";

export function mount(root, api, { record }) {
  const box = errorBox();
  const said = h("span", { class: "soft", role: "status" });
  const text = h("textarea", {
    value: record.now.notes,
    maxlength: 20000,
    "aria-label": t("notes.patient"),
    oninput: () => (said.textContent = t("notes.unsaved")),
  });
  const form = h(
    "form",
    {},
    text,
    h("p", { class: "hint" }, t("notes.hint")),
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("notes.save")), said),
  );
  onSubmit(form, box, async () => {
    if (await sendChange(record, api, { notes: text.value }, box, (now) => (text.value = now.notes))) said.textContent = t("notes.saved");
  });
  root.append(h("h2", {}, t("notes.patient")), form, box.element);
  return () => {};
}
