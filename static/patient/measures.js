/** Hand measures, in millimetres on the page and metres in the API; a hand that was not measured counts as an average adult's. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { sendChange } from "./record.js";
import { t } from "../words/words.js";

const NAMES = ["hand_length", "hand_breadth", "palm_length"];
const MM = 1000; // of a metre

export function mount(root, api, { record }) {
  const box = errorBox();
  const said = h("p", { class: "soft", role: "status" });
  const inputs = {};
  const columns = ["left", "right"].map((hand) => {
    inputs[hand] = Object.fromEntries(
      NAMES.map((name) => [name, h("input", { inputmode: "decimal", autocomplete: "off", name: `${hand}_${name}` })]),
    );
    const fields = NAMES.map((name) => field(t(`measure.${name}`), inputs[hand][name], t(`measure.${name}.hint`)));
    return h("fieldset", {}, h("legend", {}, t(`hand.${hand}.title`)), fields);
  });
  const form = h(
    "form",
    { novalidate: true },
    h("div", { class: "pair" }, columns),
    h("button", { type: "submit" }, t("measures.save")),
    said,
  );
  const fill = (patient) => eachInput(inputs, (input, hand, name) => (input.value = millimetres(patient.hand_measures?.[hand]?.[name])));

  onSubmit(form, box, async () => {
    said.textContent = "";
    const measures = structuredClone(record.now.hand_measures ?? {});
    eachInput(inputs, (input, hand, name) => {
      measures[hand] ??= {};
      delete measures[hand][name];
      const value = metres(input.value, t(`measure.${name}`));
      if (value !== null) measures[hand][name] = value;
    });
    if (await sendChange(record, api, { hand_measures: measures }, box, fill)) said.textContent = t("measures.saved");
  });
  fill(record.now);
  root.append(
    h("details", {}, h("summary", {}, h("h2", {}, t("measures.title"))), h("p", { class: "soft" }, t("measures.lead")), form, box.element),
  );
  return () => {};
}

function eachInput(inputs, act) {
  for (const [hand, named] of Object.entries(inputs)) for (const [name, input] of Object.entries(named)) act(input, hand, name);
}

function millimetres(value) {
  return value === null || value === undefined ? "" : String(Number((value * MM).toFixed(1)));
}

function metres(text, what) {
  const given = text.trim().replace(",", ".");
  if (given === "") return null;
  const value = Number(given);
  if (!Number.isFinite(value)) throw new Error(t("measures.wrong", { what, text }));
  return Number((value / MM).toFixed(6));
}
