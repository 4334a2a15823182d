/** Several words in one text, with the punctuation of the language. */
import { t } from "./words.js";

/** "a; b; c". */
export const several = (parts) => parts.join(t("between"));

/** "Index finger: moves along". */
export const labelled = (what, words) => t("labelled", { what, words });

const UNITS = ["mm/s", "mm", "cm", "%", "s", "min", "N", t("unit.per_s"), "°/s", "°"];
const NUMBERED = new RegExp(`(\\d) (${UNITS.join("|")})(?![\\p{L}\\d])`, "gu");
const APART = String.fromCharCode(0xa0);

/** Each number on one line with its unit and its deviation's sign, where a text is wrapped: "3,14 pro s", "± 0,1 mm". */
export const together = (words) => words.replace(NUMBERED, (both) => both.replaceAll(" ", APART)).replaceAll("± ", `±${APART}`);
