/** The session's date where the computer's clock was wrong: corrected with a reason; what the clock said stays and can be put back.
 * The fields themselves outlive the page that is drawn anew: of a date that is typed half there is no value to fill in again.
 */
import { h, whenChanged } from "../dom.js";
import { errorBox, field, onSubmit, once } from "../forms.js";
import { sendChange } from "../patient/record.js";
import { dayAndTime, t } from "../words/words.js";

const MINUTE = 60_000; // ms

export function mount(root, api, { record, draft }) {
  const box = errorBox();
  const note = h("div", {});
  const dating = (draft.dating ??= fields());
  const { when, why } = dating;
  const form = h(
    "form",
    { novalidate: true },
    field(t("dating.true"), when),
    field(t("dating.why"), why, t("dating.why.hint")),
    h("div", { class: "buttons" }, h("button", { class: "primary", type: "submit" }, t("dating.send"))),
  );
  const details = h("details", { open: dating.open }, h("summary", {}, h("h2", {}, t("dating.correct"))), form);
  root.append(note, details, box.element);
  dating.held?.focus();
  const draw = whenChanged(({ started, recorded_as, date_reason, state }) => ({ started, recorded_as, date_reason, state }), show);
  const stored = (now) => {
    dating.typed = false;
    show(now);
  };
  const send = (change) => sendChange(record, change, box, stored);

  onSubmit(form, box, async () => {
    if (!when.value) throw new Error(t("dating.missing"));
    if (!why.value.trim()) throw new Error(t("dating.why.missing"));
    if (!(await send({ started: new Date(when.value).toISOString(), date_reason: why.value.trim() }))) return;
    [details.open, why.value] = [false, ""];
    stored(record.now);
    details.querySelector("summary").focus();
  });

  function show({ started, recorded_as: said, date_reason: reason, state }) {
    root.hidden = state === "open";
    if (!dating.typed) when.value = local(started);
    const back = h("button", { type: "button", onclick: () => once(back, box, () => send({ started: said })) }, t("dating.back"));
    note.replaceChildren(...(said ? [h("p", {}, t("dating.corrected", { said: dayAndTime(said), reason })), back] : []));
  }

  draw(record.now);
  const leave = record.watch(draw);
  return () => {
    leave();
    dating.open = details.open;
    dating.held = [when, why].find((one) => one === document.activeElement);
  };
}

/** What is typed into, and whether something was. */
function fields() {
  const kept = {
    when: h("input", { type: "datetime-local", name: "started", required: true, oninput: () => (kept.typed = true) }),
    why: h("input", { maxlength: 1000, autocomplete: "off", name: "reason" }),
    typed: false,
  };
  return kept;
}

/** A moment as the field takes it: this computer's local time. */
function local(moment) {
  const at = new Date(moment);
  return new Date(at.getTime() - at.getTimezoneOffset() * MINUTE).toISOString().slice(0, 16);
}
