/** Facts of a patient, shown; "Change" makes them a form. */
import { h, whenChanged } from "../dom.js";
import { errorBox, onSubmit } from "../forms.js";
import { confirming } from "./confirmation.js";
import { factFields, factWords } from "./fact_fields.js";
import { sendChange } from "./record.js";
import { loadWards, wardName } from "./ward_names.js";
import { t } from "../words/words.js";

const NAMES = ["pseudonym", "year_of_birth", "dominant_hand", "affected_hand", "ward"];

export function mount(root, api, { record }) {
  const box = errorBox();
  const body = h("div", {});
  let wards = [];
  let several = false; // wards; else nothing about them is shown
  root.append(h("h2", {}, t("facts.title")), body, box.element);

  function show() {
    const patient = record.now;
    const shown = NAMES.filter((name) => name !== "ward" || several);
    const words = (name) => (name === "ward" ? wardName(patient.ward, patient.ward_name) : factWords(name, patient[name]));
    const rows = shown.map((name) => [h("dt", {}, t(`fact.${name}`)), h("dd", {}, words(name))]);
    body.replaceChildren(
      h("dl", { class: "facts" }, rows),
      h("p", { class: "buttons" }, h("button", { class: "clinicians", onclick: edit }, t("facts.change"))),
    );
  }

  function edit() {
    const seen = record.now;
    const fields = factFields(seen);
    fields.offerWards(wards);
    const close = () => {
      box.clear();
      show();
      body.querySelector("button").focus();
    };
    const buttons = [
      h("button", { class: "primary", type: "submit" }, t("save")),
      h("button", { type: "button", onclick: close }, t("cancel")),
    ];
    const form = h("form", { novalidate: true }, fields.elements, h("div", { class: "buttons" }, buttons));
    const send = (more) => sendChange(record, { ...fields.values(), ...more }, box, fields.set, seen);
    onSubmit(form, box, () => confirming(box, send, (done) => done && close()));
    body.replaceChildren(form);
    fields.first.focus();
  }

  const draw = whenChanged(
    (patient) => NAMES.map((name) => patient[name]),
    () => body.querySelector("form") || show(),
  );
  draw(record.now);
  loadWards(api).then((all) => {
    wards = all;
    several = all.length > 1;
    if (several && !body.querySelector("form")) show();
  }, box.show);
  return record.watch(draw);
}
