/** Notes of the session, and who examined; saved when asked, printed in the report. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { t } from "../words/words.js";

export function mount(root, api, { session }) {
  const box = errorBox();
  const said = h("span", { class: "soft", role: "status" });
  const changed = () => (said.textContent = t("notes.unsaved"));
  const text = h("textarea", { value: session.notes, maxlength: 20000, name: "notes", "aria-label": t("notes.session"), oninput: changed });
  const examiner = h("input", { value: session.examiner, maxlength: 200, name: "examiner", autocomplete: "off", oninput: changed });
  const form = h(
    "form",
    { novalidate: true },
    h("div", { class: "field" }, text, h("p", { class: "hint" }, t("notes.session.hint"))),
    field(t("new_session.examiner"), examiner),
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("notes.save")), said),
  );
  onSubmit(form, box, async () => {
    const kept = await api.patch(`/api/sessions/${session.id}`, { notes: text.value, examiner: examiner.value.trim() });
    session.notes = kept.notes;
    said.textContent = t("notes.saved");
  });
  root.append(h("h2", {}, t("notes.session")), form, box.element);
  return () => {};
}
