/** The map of a table's columns as it is edited, and as MAP.json has it. */
import { t } from "../words/words.js";

/** What is edited: the map last used for this header where there is one, else the guess. */
export function startingMap(seen, stored) {
  const from = stored || seen.map || {};
  return {
    stored: Boolean(stored),
    hand: seen.map?.hand ?? "left",
    time: from.time ?? null,
    rate: from.rate ?? 100,
    triads: stored ? listed(stored.sensors) : seen.triads.map((triad) => ({ ...triad })),
    mountings: Object.fromEntries(Object.entries(from.sensors ?? {}).map(([point, sensor]) => [point, sensor.mounting])),
  };
}

function listed(sensors) {
  return Object.entries(sensors).flatMap(([point, sensor]) =>
    Object.entries(sensor)
      .filter(([quantity]) => quantity !== "mounting")
      .map(([quantity, channels]) => ({ quantity, point, columns: channels.columns, unit: channels.unit })),
  );
}

/** MAP.json; columns without a segment are left out. */
export function mapOf(state, seen) {
  const sensors = {};
  for (const { quantity, point, columns, unit } of state.triads) {
    if (!point) continue;
    sensors[point] ??= state.mountings[point] ? { mounting: state.mountings[point] } : {};
    if (sensors[point][quantity]) return { twice: [point, quantity] };
    sensors[point][quantity] = { columns, unit };
  }
  const time = state.time ? { time: state.time } : { rate: state.rate };
  return { hand: state.hand, table: seen.layout, ...time, sensors };
}

/** The choices for a column: its name, or its number from 0 where there is no header. */
export function columnChoices(seen) {
  if (seen.names.length) return seen.names.map((name) => [name, name]);
  return Array.from({ length: seen.columns }, (_, k) => [String(k), t("table.column", { number: k })]);
}

export const columnOf = (seen, word) => (seen.names.length ? word : Number(word));
