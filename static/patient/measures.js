/** Hand measures with a picture of how to take each, in millimetres on the page and metres in the API; what is not measured is derived. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import { handDrawing } from "./hand_drawing.js";
import { metres, millimetres } from "./lengths.js";
import { sendChange } from "./record.js";
import { t } from "../words/words.js";

const HANDS = ["left", "right"];
const WHOLE = ["hand_length", "hand_breadth", "palm_length"];
const FINGERS = ["thumb", "index", "middle", "ring", "little"];

export function mount(root, api, { record, treats }) {
  const box = errorBox();
  const said = h("p", { class: "soft", role: "status" });
  const whole = WHOLE.map((name) => entry(t(`measure.${name}`), [name], how(name)));
  const fingers = FINGERS.map((finger) => entry(t("measure.finger", { finger: t(`finger.${finger}`) }), ["finger_length", finger]));
  const inputs = [...whole, ...fingers].flatMap((made) => made.inputs);
  const trunk = h("input", { inputmode: "decimal", autocomplete: "off", name: "trunk_height" });
  [...inputs, { input: trunk }].forEach(({ input }) => (input.readOnly = !treats));
  const pictured = (name, content) => h("div", { class: "measure" }, handDrawing(name), content);
  const more = h(
    "details",
    {},
    h("summary", {}, t("measures.fingers")),
    pictured("finger_length", how("finger_length")),
    fingers.map((made) => made.element),
  );
  const rows = whole.map((made, k) => pictured(WHOLE[k], made.element));
  const sitting = h(
    "fieldset",
    {},
    h("legend", {}, t("measure.trunk_height")),
    h("p", { class: "hint" }, t("measure.trunk_height.how")),
    h("div", { class: "pair" }, field(t("measure.trunk_height.field"), trunk)),
  );
  const save = h("button", { type: "submit", class: "clinicians" }, t("measures.save"));
  const form = h("form", { novalidate: true }, rows, more, sitting, save, said);
  let seen = record.now;
  const shown = ({ path }) => millimetres(valueOf(seen.hand_measures, path));
  const fill = (patient) => {
    seen = patient;
    inputs.forEach((one) => (one.input.value = shown(one)));
    trunk.value = millimetres(seen.trunk_height);
  };

  onSubmit(form, box, async () => {
    said.textContent = "";
    const measures = structuredClone(seen.hand_measures ?? {});
    for (const { input, path, label } of inputs) put(measures, path, metres(input.value, label));
    const trunk_height = metres(trunk.value, t("measure.trunk_height"));
    if (!(await sendChange(record, { hand_measures: measures, trunk_height }, box, fill, seen))) return;
    fill(record.now);
    said.textContent = t("measures.saved");
  });
  fill(record.now);
  root.append(
    h("details", {}, h("summary", {}, h("h2", {}, t("measures.title"))), h("p", { class: "soft" }, t("measures.lead")), form, box.element),
  );
  const typed = () => trunk.value !== millimetres(seen.trunk_height) || inputs.some((one) => one.input.value !== shown(one));
  return record.watch((now) => typed() || fill(now));
}

const how = (name) => h("p", { class: "hint" }, t(`measure.${name}.how`));

/** A measure of both hands: its group, and its inputs with where their values belong. */
function entry(label, path, ...about) {
  const inputs = HANDS.map((hand) => {
    const input = h("input", { inputmode: "decimal", autocomplete: "off", name: [hand, ...path].join("_") });
    return { input, path: [hand, ...path], label: t("measure.of", { label, hand: t(`hand.${hand}`) }) };
  });
  const fields = inputs.map(({ input }, k) => field(t(`hand.${HANDS[k]}.title`), input));
  return { inputs, element: h("fieldset", {}, h("legend", {}, label), about, h("div", { class: "pair" }, fields)) };
}

const valueOf = (measures, path) => path.reduce((within, key) => within?.[key], measures);

/** Set a value where it belongs, or take it out. */
function put(measures, path, value) {
  const last = path.at(-1);
  if (value === null) return delete (valueOf(measures, path.slice(0, -1)) ?? {})[last];
  const place = path.slice(0, -1).reduce((within, key) => (within[key] ??= {}), measures);
  return (place[last] = value);
}
