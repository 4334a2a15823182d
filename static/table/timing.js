/** The column of the times with its unit, or so many rows a second. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";
import { columnChoices, columnOf } from "./map.js";

/** @param {import("../types/api.d.ts").TableAnswer} seen */
export function make(seen, state, changed) {
  const column = select([["", t("table.time.none")], ...columnChoices(seen)], state.time ? String(state.time.column) : "");
  const unit = select(
    seen.choices.seconds.map((word) => [word, word]),
    state.time?.unit ?? "s",
  );
  const rate = h("input", { type: "number", min: 1, max: 10000, step: "any", value: String(state.rate), inputmode: "decimal" });
  const units = field(t("table.time.unit"), unit);
  const rates = field(t("table.rate"), rate);
  const take = () => {
    state.time = column.value ? { column: columnOf(seen, column.value), unit: unit.value } : null;
    state.rate = Number(rate.value);
    units.hidden = !state.time;
    rates.hidden = Boolean(state.time);
  };
  const fields = h("div", { class: "options" }, field(t("table.time.column"), column), units, rates);
  fields.addEventListener("change", () => {
    take();
    changed();
  });
  take();
  return fields;
}
