/** Notes on the patient, one by one with their day: added, corrected, removed and, with "Undo", brought back. */
import { h } from "../dom.js";
import { draftOf } from "../drafts.js";
import { errorBox, onSubmit, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

const LONGEST = 20000;

export function mount(root, api, { record }) {
  const box = errorBox();
  const list = h("ol", { class: "notes" });
  const draft = draftOf(`patient ${record.now.id}`);
  const typed = () => (draft.typed = text.value);
  const text = h("textarea", { value: draft.typed ?? "", maxlength: LONGEST, "aria-label": t("notes.new"), oninput: typed });
  const form = h(
    "form",
    {},
    text,
    h("p", { class: "hint" }, t("notes.hint")),
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("notes.add"))),
  );
  onSubmit(form, box, async () => {
    const note = await api.post(`/api/patients/${record.now.id}/notes`, { text: text.value });
    draft.typed = text.value = "";
    list.prepend(one(api, note));
  });
  list.append(...record.now.notes.map((note) => one(api, note)));
  root.append(h("h2", {}, t("notes.patient")), form, box.element, list);
  return () => {};
}

/**
 * A note's place in the list, whatever becomes of the note.
 * @param {import("../types/api.d.ts").NoteRow} note
 */
function one(api, note) {
  const place = h("li", {});
  const box = errorBox();
  let now = note;
  const send = async (change) => (now = await api.patch(`/api/notes/${note.id}`, { version: now.version, ...change }));
  const button = (word, act, kind = "plain") => {
    const element = h("button", { type: "button", class: kind, onclick: () => once(element, box, act) }, word);
    return element;
  };
  const draw = (...parts) => place.replaceChildren(...parts, box.element);

  function show(focus) {
    const change = button(t("notes.change"), edit);
    const remove = button(t("notes.remove"), () => send({ removed: true }).then(removed));
    const when = h("div", { class: "soft small" }, dayAndTime(now.written));
    draw(h("p", { class: "text" }, now.text), when, h("div", { class: "buttons" }, change, remove));
    if (focus) change.focus();
  }

  function removed() {
    const undo = button(t("undo"), () => send({ removed: false }).then(() => show(true)), "");
    draw(h("div", { class: "buttons" }, h("span", { role: "status" }, t("notes.removed")), undo));
    undo.focus();
  }

  function edit() {
    const area = h("textarea", { value: now.text, maxlength: LONGEST, "aria-label": t("notes.text") });
    const save = h("button", { class: "primary", type: "submit" }, t("save"));
    const form = h("form", {}, area, h("div", { class: "buttons" }, save, button(t("cancel"), () => show(true), "")));
    onSubmit(form, box, () => send({ text: area.value }).then(() => show(true), (error) => settle(error, area)));
    draw(form);
    area.focus();
  }

  /** Somebody else was faster: what is stored stands beside what was typed, and the person chooses. */
  async function settle(error, area) {
    const stored = error.status === 409 && (await api.get(`/api/notes/${note.id}`).catch(() => null));
    if (!stored) throw error;
    now = stored;
    const theirs = button(t("conflict.theirs"), () => show(true), "");
    const mine = button(t("conflict.mine"), () => send({ text: area.value }).then(() => show(true)), "");
    box.show(error, h("p", { class: "text" }, now.text), h("div", { class: "buttons" }, theirs, mine));
  }

  show(false);
  return place;
}
