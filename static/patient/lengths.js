/** Lengths: metres in the API, millimetres on the page. */
import { t } from "../words/words.js";

const MM = 1000; // of a metre

export function millimetres(value) {
  return value === null || value === undefined ? "" : String(Number((value * MM).toFixed(1)));
}

/** What was typed, in metres; null where nothing was. */
export function metres(text, what) {
  const given = text.trim().replace(",", ".");
  if (given === "") return null;
  const value = Number(given);
  if (!Number.isFinite(value)) throw new Error(t("measures.wrong", { what, text }));
  return Number((value / MM).toFixed(6));
}
