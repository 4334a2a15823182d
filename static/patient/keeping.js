/** What becomes of everything about a patient: a file to take away, the archive and back, or erased for good. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit, once } from "../forms.js";
import { counted, t } from "../words/words.js";
import { sendChange } from "./record.js";

export function mount(root, api, { record, erased }) {
  const box = errorBox();
  const archive = h("div", { class: "buttons spaced" });
  const put = async (archived) => {
    const done = await sendChange(record, { archived }, box, () => draw(""));
    if (done) draw(archived ? "keeping.archived" : "keeping.back");
  };

  /** The button; after a press what was done, with the way back. */
  function draw(said) {
    const { archived } = record.now;
    const words = said && [h("span", { role: "status" }, t(said)), t("undo")];
    const [status, label] = words || [null, t(archived ? "facts.unarchive" : "facts.archive")];
    const button = h("button", { onclick: () => once(button, box, () => put(!archived)) }, label);
    archive.replaceChildren(...[status, button].filter(Boolean));
    if (said) button.focus();
  }

  draw("");
  root.append(
    h("h2", {}, t("keeping.title")),
    h("p", {}, h("a", { class: "button", href: `/api/patients/${record.now.id}/export.zip`, download: "" }, t("keeping.export"))),
    h("p", { class: "hint" }, t("keeping.export.hint")),
    archive,
    box.element,
    erasing(api, record, erased),
  );
  return () => {};
}

function erasing(api, record, erased) {
  const box = errorBox();
  const code = h("input", { autocomplete: "off", spellcheck: "false", name: "erase" });
  const form = h(
    "form",
    { novalidate: true },
    h("p", {}, h("strong", {}, t("erase.never"))),
    h("p", {}, t("erase.what", { sessions: counted("sessions", record.now.sessions.length) })),
    h("p", {}, t("erase.copies")),
    field(t("erase.type", { code: record.now.pseudonym }), code),
    box.element,
    h("button", { class: "danger", type: "submit" }, t("erase.send")),
  );
  onSubmit(form, box, async () => erased(await api.post(`/api/patients/${record.now.id}/erasure`, { pseudonym: code.value })));
  return h("details", {}, h("summary", {}, t("erase.open")), form);
}
