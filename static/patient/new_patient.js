/** The form for a new patient: a code, never a name. */
import { h } from "../dom.js";
import { errorBox, onSubmit } from "../forms.js";
import { confirming } from "./confirmation.js";
import { factFields } from "./fact_fields.js";
import { loadWards } from "./ward_names.js";
import { t } from "../words/words.js";

export function mount(root, api, { done, cancel }) {
  const fields = factFields({});
  const box = errorBox();
  loadWards(api).then((wards) => fields.offerWards(wards.filter((ward) => ward.own)), box.show);
  const form = h(
    "form",
    { novalidate: true },
    h("h2", {}, t("patients.new")),
    fields.elements,
    box.element,
    h(
      "div",
      { class: "buttons" },
      h("button", { class: "primary", type: "submit" }, t("patients.create")),
      h("button", { type: "button", onclick: cancel }, t("cancel")),
    ),
  );
  onSubmit(form, box, () => confirming(box, (more) => api.post("/api/patients", { ...fields.values(), ...more }), done));
  root.append(form);
  fields.first.focus();
  return () => form.remove();
}
