/** Words of the pages: `t` gives a text of the language in use, with {names} filled in; what a language lacks comes in English. */
import { language } from "./languages.js";

const words = (await import(`../../languages/${language}.js`)).default;

export function t(key, values = {}) {
  const text = words[key];
  if (text === undefined) throw new Error(`there are no words for ${key}`);
  return text.replace(/\{(\w+)\}/g, (whole, name) => filled(values[name] ?? whole));
}

/** A text where there is one, else `otherwise`. */
export function known(key, otherwise) {
  return words[key] ?? otherwise;
}

const locale = words["locale"];
const plurals = new Intl.PluralRules(locale);

/** "1 session", "3 sessions": the words `key.one`, `key.few`, ... by the locale's plural rules; `key.other` where one is not there. */
export function counted(key, count, values = {}) {
  const form = `${key}.${plurals.select(count)}`;
  return t(form in words ? form : `${key}.other`, { ...values, count: whole(count) });
}

const POINT = (1.5).toLocaleString(locale).charAt(1);
const dayForm = new Intl.DateTimeFormat(locale, { day: "numeric", month: "long", year: "numeric" });
const timeForm = new Intl.DateTimeFormat(locale, { hour: "2-digit", minute: "2-digit" });
const wholeForm = new Intl.NumberFormat(locale);

const NO_BREAK = String.fromCharCode(0xa0);

/** Dates in the form of the language. */
export const dateForm = (options) => new Intl.DateTimeFormat(locale, options);
export const day = (moment) => dayForm.format(new Date(moment));
export const time = (moment) => timeForm.format(new Date(moment));
const shortForm = new Intl.DateTimeFormat(locale, { day: "numeric", month: "short", year: "numeric" });
/** For a table's column: the day stays on one line. */
export const shortDayAndTime = (moment) => `${shortForm.format(new Date(moment)).replace(/ /g, NO_BREAK)}, ${time(moment)}`;
export const dayAndTime = (moment) => `${day(moment)}, ${time(moment)}`;
/** A number with so many decimals. */
export const decimal = (value, digits) => Number(value).toFixed(digits).replace(".", POINT);
export const whole = (number) => wholeForm.format(number);

/** A number as it is, with the point of the language: 2.5 is 2,5 in German. */
export const plain = (number) => String(number).replace(".", POINT);

/** What stands in a gap: a text, such as a version or a code, stays as it is. */
const filled = (value) => (typeof value === "number" ? plain(value) : value);

/** Seconds as "0:07" or "12:30". */
export function clock(seconds) {
  const total = Math.max(0, Math.floor(seconds));
  return `${Math.floor(total / 60)}:${String(total % 60).padStart(2, "0")}`;
}
