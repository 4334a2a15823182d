/** Several words in one text, with the punctuation of the language. */
import { t } from "./words.js";

/** "a; b; c". */
export const several = (parts) => parts.join(t("between"));

/** "Index finger: moves along". */
export const labelled = (what, words) => t("labelled", { what, words });
