/** Columns that belong together: what they measure, in which unit, on which segment. */
import { h } from "../dom.js";
import { select } from "../forms.js";
import { t } from "../words/words.js";
import { columnChoices, columnOf } from "./map.js";

const COMPONENTS = { gyr: "xyz", acc: "xyz", mag: "xyz", orientation: "wxyz" };

/** @param {import("../types/api.d.ts").TableAnswer} seen */
export function make(seen, state, changed) {
  const list = h("ol", { class: "mapped" });
  const options = columnChoices(seen);
  const draw = () => list.replaceChildren(...state.triads.map(row));

  /** A row anew: with another quantity it has other units, and may have another number of columns. */
  function row(triad, k) {
    const named = (key) => ({ "aria-label": t(key, { number: k + 1 }) });
    const quantity = select(
      Object.keys(COMPONENTS).map((name) => [name, t(`table.quantity.${name}`)]),
      triad.quantity,
      named("table.quantity"),
    );
    const unit = select(
      seen.choices.units[triad.quantity].map((word) => [word, word === "1" ? t("table.no_unit") : word]),
      triad.unit,
      named("table.unit"),
    );
    const point = select(
      [["", t("table.point.none")], ...seen.choices.points.map(({ name, title }) => [name, title])],
      triad.point ?? "",
      named("table.point"),
    );
    const cells = [...COMPONENTS[triad.quantity]].map((component, j) =>
      select(options, String(triad.columns[j]), { "aria-label": t("table.component", { number: k + 1, component }) }),
    );
    quantity.addEventListener("change", () => {
      const count = COMPONENTS[quantity.value].length;
      const columns = Array.from({ length: count }, (_, j) => triad.columns[j] ?? triad.columns[0]);
      Object.assign(triad, { quantity: quantity.value, unit: seen.choices.units[quantity.value][0], columns });
      const drawn = row(triad, k);
      list.children[k].replaceWith(drawn);
      drawn.querySelector("select").focus();
      changed();
    });
    const remove = h("button", { type: "button", class: "plain", ...named("table.remove"), onclick: () => drop(k) }, "×");
    const item = h(
      "li",
      { class: triad.point ? "" : "open" },
      h("div", { class: "what" }, point, quantity, unit, remove),
      h("div", { class: "cells" }, cells),
    );
    item.addEventListener("change", (event) => {
      if (event.target === quantity) return;
      triad.unit = unit.value;
      triad.point = point.value || null;
      triad.columns = cells.map((cell) => columnOf(seen, cell.value));
      item.classList.toggle("open", !triad.point);
      changed();
    });
    return item;
  }

  function drop(k) {
    state.triads.splice(k, 1);
    draw();
    (list.children[Math.min(k, list.children.length - 1)] ?? add).querySelector("select")?.focus();
    changed();
  }

  const add = h(
    "button",
    {
      type: "button",
      onclick: () => {
        const first = columnOf(seen, options[0][0]);
        state.triads.push({ quantity: "gyr", unit: "rad/s", point: null, columns: [first, first, first] });
        draw();
        list.lastElementChild.querySelector("select").focus();
      },
    },
    t("table.add"),
  );
  draw();
  return [h("p", { class: "soft" }, t("table.columns.lead")), list, add];
}
