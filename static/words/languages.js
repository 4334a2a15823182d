/** Which languages there are, and which of them this browser wants. */
// @ts-expect-error: the server writes this module
import LANGUAGES from "/languages/names.js";

export { LANGUAGES };
const KEPT = "handscope-language";

/** The code of the language in use: what was chosen here, else the first of the browser's languages that there is, else English. */
export const language = [kept(), ...navigator.languages.map((tag) => tag.split("-")[0])].find((code) => code in LANGUAGES) ?? "en";
document.documentElement.lang = language;

/** Keep the choice in this browser and load the page anew in it. */
export function choose(code) {
  localStorage.setItem(KEPT, code);
  location.reload();
}

function kept() {
  return localStorage.getItem(KEPT) ?? "";
}
