/** Words of the pages: `t` gives a text of the language in use, with {names} filled in; what a language lacks is said in English. */
import en from "./en.js";
import { language } from "./languages.js";

const words = language === "en" ? en : { ...en, ...(await import(`./${language}.js`)).default };

export function t(key, values = {}) {
  const text = words[key];
  if (text === undefined) throw new Error(`there are no words for ${key}`);
  return text.replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}

/** A text where there is one, else `otherwise`. */
export function known(key, otherwise) {
  return words[key] ?? otherwise;
}

/** "1 session", "3 sessions": the words `key.one` or `key.many`. */
export function counted(key, count) {
  return t(count === 1 ? `${key}.one` : `${key}.many`, { count });
}

const locale = words["locale"];
const dayForm = new Intl.DateTimeFormat(locale, { day: "numeric", month: "long", year: "numeric" });
const timeForm = new Intl.DateTimeFormat(locale, { hour: "2-digit", minute: "2-digit" });
const wholeForm = new Intl.NumberFormat(locale);

const shortForm = new Intl.DateTimeFormat(locale, { day: "numeric", month: "short" });

export const day = (moment) => dayForm.format(new Date(moment));
export const shortDay = (moment) => shortForm.format(new Date(moment));
export const time = (moment) => timeForm.format(new Date(moment));
export const dayAndTime = (moment) => `${day(moment)}, ${time(moment)}`;
export const whole = (number) => wholeForm.format(number);

/** Seconds as "0:07" or "12:30". */
export function clock(seconds) {
  const total = Math.max(0, Math.floor(seconds));
  return `${Math.floor(total / 60)}:${String(total % 60).padStart(2, "0")}`;
}
