/** Process the same recording by another method or with other options; the form is made from what the API says of the methods. */
import { h } from "../dom.js";
import { errorBox, field, initial, onSubmit, select } from "../forms.js";
import { labelled, several } from "../words/joined.js";
import { unitSigns } from "../words/clinical.js";
import { t } from "../words/words.js";

export function mount(root, api, { session, result, go }) {
  const box = errorBox();
  const place = h("div", {}, h("p", { class: "soft" }, t("loading")));
  let gone = false;
  root.append(
    h(
      "details",
      { open: result?.state === "failed" },
      h("summary", {}, h("h2", {}, t("again.title"))),
      h("p", { class: "soft" }, t("again.lead")),
      place,
      box.element,
    ),
  );
  api.get("/api/methods").then(
    (methods) => gone || draw(methods),
    (error) => gone || box.show(error),
  );

  function draw(methods) {
    const options = h("div", { class: "options" });
    const abilities = h("p", { class: "hint", "aria-live": "polite" });
    const choice = select(
      methods.map((m) => [m.name, labelled(m.name, m.title)]),
      result?.method ?? initial(methods),
      { onchange: showOptions },
    );
    const form = h(
      "form",
      { novalidate: true },
      field(t("again.method"), choice),
      abilities,
      h("details", {}, h("summary", {}, t("again.options")), options),
      h("p", {}, h("button", { class: "primary", type: "submit" }, t("again.send"))),
    );
    const chosen = () => methods.find((m) => m.name === choice.value);
    let controls = new Map();

    function showOptions() {
      abilities.textContent = several(chosen().abilities);
      controls = new Map(chosen().options.map((o) => [o, control(o, result?.parameters?.[o.name] ?? o.default)]));
      options.replaceChildren(
        ...[...controls].map(([o, input]) => {
          const source = t("again.source", { initial: valueWords(o, o.default), source: o.source });
          return field(unitSigns(labelOf(o)), input, unitSigns(source));
        }),
      );
    }

    showOptions();
    onSubmit(form, box, async () => {
      const changed = [...controls]
        .filter(([o, input]) => input.value.trim() !== String(o.default))
        .map(([o, input]) => [o.name, input.value.trim()]);
      const created = await api.post(`/api/sessions/${session.id}/results`, { method: choice.value, options: Object.fromEntries(changed) });
      go(`/sessions/${session.id}?result=${created.result}`);
    });
    place.replaceChildren(form);
  }

  return () => {
    gone = true;
  };
}

function labelOf(option) {
  const meaning = option.meaning[0].toUpperCase() + option.meaning.slice(1);
  return option.unit ? `${meaning} (${option.unit})` : meaning;
}

function control(option, value) {
  const name = option.name;
  const offered = option.kind === "bool" ? [true, false] : option.choices;
  if (offered.length)
    return select(
      offered.map((one) => [String(one), valueWords(option, one)]),
      String(value),
      { name },
    );
  return h("input", { name, value: String(value), inputmode: option.kind === "str" ? "text" : "decimal", autocomplete: "off" });
}

function valueWords(option, value) {
  if (option.kind === "bool") return value ? t("yes") : t("no");
  return option.choice_words[option.choices.indexOf(value)] ?? value;
}
