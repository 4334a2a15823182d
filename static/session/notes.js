/** Conclusion, pain, notes and examiner of the session; printed in the report. */
import { h } from "../dom.js";
import { draftOf } from "../drafts.js";
import { errorBox, field, onSubmit, once, select } from "../forms.js";
import { sendChange } from "../patient/record.js";
import { t } from "../words/words.js";

const SCORES = [...Array(11).keys()].map((score) => [String(score), String(score)]); // numerical rating scale

export function mount(root, api, { record }) {
  const draft = draftOf(`session ${record.now.id}`);
  const box = errorBox();
  const status = h("span", { class: "soft", role: "status" });
  const undo = h("button", { type: "button", hidden: true }, t("undo"));
  let seen = draft.seen ?? record.now; // as it was when the person began to type
  const typed = () => {
    draft.seen = seen;
    draft.typed = values();
    say(t("notes.unsaved"));
  };
  const text = h("textarea", { maxlength: 20000, name: "notes", oninput: typed });
  const conclusion = h("textarea", { maxlength: 20000, name: "conclusion", oninput: typed });
  const [rest, movement] = ["pain_rest", "pain_movement"].map((name) =>
    select([["", t("pain.not_asked")], ...SCORES], "", { name, oninput: typed }),
  );
  const examiner = h("input", { maxlength: 200, name: "examiner", autocomplete: "off", oninput: typed });
  const form = h(
    "form",
    { novalidate: true },
    field(t("conclusion"), conclusion, t("conclusion.hint")),
    h("div", { class: "pair" }, field(t("pain.rest"), rest), field(t("pain.movement"), movement)),
    field(t("notes.session"), text, t("notes.session.hint")),
    field(t("new_session.examiner"), examiner),
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("notes.save")), undo, status),
  );
  root.append(h("h2", {}, t("notes.title")), form, box.element);
  fill(draft.typed ?? record.now);
  if (draft.typed) say(t("notes.unsaved"));
  if (draft.held) form.elements[draft.held].focus();

  const score = ({ value }) => (value === "" ? null : Number(value));
  const values = () => ({
    notes: text.value,
    examiner: examiner.value.trim(),
    conclusion: conclusion.value,
    pain_rest: score(rest),
    pain_movement: score(movement),
  });

  function fill(facts) {
    [text.value, examiner.value, conclusion.value] = [facts.notes, facts.examiner, facts.conclusion];
    [rest.value, movement.value] = [facts.pain_rest ?? "", facts.pain_movement ?? ""];
  }

  function say(words, back = null) {
    status.textContent = words;
    undo.hidden = !back;
    undo.onclick = back;
  }

  /** What is stored now, in the fields and as what the next change is begun from. */
  function settle() {
    seen = record.now;
    fill(seen);
    for (const name of ["seen", "typed"]) delete draft[name];
  }

  async function save(wanted) {
    const changed = Object.keys(wanted).filter((name) => wanted[name] !== seen[name]);
    const before = Object.fromEntries(changed.map((name) => [name, seen[name]])); // another person's change is not for this one to undo
    const stored = (now, mine) => {
      settle();
      say(mine ? t("notes.saved") : "");
    };
    if (!(await sendChange(record, wanted, box, stored, seen))) return;
    settle();
    say(t("notes.saved"), changed.length && (() => once(undo, box, () => save(before))));
  }

  onSubmit(form, box, () => save(values()));
  return () => {
    draft.held = form.contains(document.activeElement) ? document.activeElement.getAttribute("name") ?? "" : "";
  };
}
