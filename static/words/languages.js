/** Which languages there are, and which of them this browser wants. */
// @ts-expect-error: the server writes this module
import LANGUAGES from "../../languages/names.js";

export { LANGUAGES };
const KEPT = "handscope-language";
const PATIENTS = "/patient-view"; // its language is the patient's, whoever used this browser before

/** The language in use: on the patient's screen that of the invitation, elsewhere the chosen one, else the browser's, else English. */
const wanted = [asked(), kept(), ...navigator.languages.map((tag) => tag.split("-")[0])];
export const language = wanted.find((code) => code in LANGUAGES) ?? "en";
document.documentElement.lang = language;

/** Headers of requests: sentences in an answer come in this language, with times by the clock that the page itself tells them by. */
export const READER = { "Accept-Language": language, "Time-Zone": Intl.DateTimeFormat().resolvedOptions().timeZone ?? "" };

/** Keep the choice in this browser and load the page anew in it. */
export function choose(code) {
  localStorage.setItem(KEPT, code);
  location.reload();
}

function asked() {
  return location.pathname === PATIENTS ? new URLSearchParams(location.search).get("language") : null;
}

function kept() {
  return localStorage.getItem(KEPT) ?? "";
}
