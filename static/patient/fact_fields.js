/** The fields of a patient's facts, for a new patient and for changes. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

const HANDS = [
  ["", "hand.unknown"],
  ["left", "hand.left"],
  ["right", "hand.right"],
];

/** `elements` to place, `values()` as the API takes them, `set(patient)`, the `first` field. */
export function factFields(patient) {
  const pseudonym = h("input", { maxlength: 64, autocomplete: "off", spellcheck: "false", name: "pseudonym" });
  const year = h("input", { inputmode: "numeric", maxlength: 4, autocomplete: "off", name: "year" });
  const dominant = select(
    HANDS.map(([key, word]) => [key, t(word)]),
    "",
    { name: "dominant" },
  );
  const affected = select(
    [...HANDS, ["both", "hand.both"]].map(([key, word]) => [key, t(word)]),
    "",
    { name: "affected" },
  );
  const wardPlace = h("div", {});
  let ward = null;
  /** A choice of wards, where there are several. */
  const offerWards = (wards) => {
    if (wards.length < 2) return;
    const options = wards.map(({ id, name }) => [String(id), name]);
    ward = select(options, String(patient.ward ?? wards[0].id), { name: "ward" });
    wardPlace.replaceChildren(field(t("fact.ward"), ward));
  };
  const set = (facts) => {
    if (ward && facts.ward) ward.value = String(facts.ward);
    pseudonym.value = facts.pseudonym ?? "";
    year.value = facts.year_of_birth ?? "";
    dominant.value = facts.dominant_hand ?? "";
    affected.value = facts.affected_hand ?? "";
  };
  set(patient);
  return {
    first: pseudonym,
    set,
    offerWards,
    elements: [
      field(t("fact.pseudonym"), pseudonym, t("fact.pseudonym.hint")),
      field(t("fact.year_of_birth"), year, t("fact.year_of_birth.hint")),
      h("div", { class: "pair" }, field(t("fact.dominant_hand"), dominant), field(t("fact.affected_hand"), affected)),
      wardPlace,
    ],
    values: () => ({
      pseudonym: pseudonym.value.trim(),
      year_of_birth: year.value.trim() === "" ? null : yearOf(year.value.trim()),
      dominant_hand: dominant.value || null,
      affected_hand: affected.value || null,
      ...(ward && Number(ward.value) !== patient.ward ? { ward: Number(ward.value) } : {}),
    }),
  };
}

function yearOf(text) {
  if (!/^\d{4}$/.test(text)) throw new Error(t("fact.year_of_birth.wrong"));
  return Number(text);
}

/** A fact's value as a person reads it. */
export function factWords(name, value) {
  if (value === null || value === undefined || value === "") return t("not_given");
  if (name === "started") return dayAndTime(value);
  return name.endsWith("_hand") ? t(`hand.${value}`) : String(value);
}
