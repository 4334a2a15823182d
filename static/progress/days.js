/** Days of the calendar as numbers, in this browser's time: sessions and treatment stand on one axis. */
import { dateForm } from "../words/words.js";

const DAY = 86_400_000; // ms
const MONTHS = 300; // days from which an axis has months and years

const forms = { day: { day: "numeric", month: "short" }, month: { month: "short", year: "numeric" } };

/** A moment as a number of days, with its time of day as the fraction. */
export function dayOf(moment) {
  const at = new Date(moment);
  return at.getTime() / DAY - at.getTimezoneOffset() / 1440;
}

/** A day without a time, "2026-05-20". */
export const dayNumber = (day) => Date.parse(`${day}T00:00:00Z`) / DAY;

/** Steps between ticks: whole days, so that no tick says what its neighbour says. */
export const STEPS = [1, 2, 5, 10, 20, 30, 60, 90, 180, 365, 730, 1825, 3650];

/** What stands at the ticks. */
export function tickDays(ticks) {
  const kind = ticks.length > 1 && ticks.at(-1) - ticks[0] > MONTHS ? "month" : "day";
  const form = dateForm({ ...forms[kind], timeZone: "UTC" });
  const words = ticks.map((tick) => form.format(new Date(tick * DAY)));
  return words.map((word, k) => (word === words[k - 1] ? "" : word));
}
