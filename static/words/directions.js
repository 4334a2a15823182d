/** What the sign of a figure stands for that is a change itself, as the report has it (app/report/units.py). */
const DIRECTIONS = {
  _fatigue: ["slower", "faster"],
  _interval_slope: ["shorter", "longer"],
  _decrement_: ["smaller", "larger"],
};
const OTHERS = ["smaller", ""];

/** What values of a figure below and above zero are; "" where that needs no word. */
export function directionsOf(name) {
  const part = Object.keys(DIRECTIONS).find((part) => name.includes(part));
  return part ? DIRECTIONS[part] : OTHERS;
}
