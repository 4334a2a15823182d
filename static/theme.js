/** Light, dark, or as the device has it: kept in this browser. colors.css has one block for dark; here it is decided when that holds. */
const KEPT = "handscope-theme";
const SCHEME = "(prefers-color-scheme: dark)";
const HOLDS = { auto: SCHEME, light: "not all", dark: "all" };
export const THEMES = Object.keys(HOLDS);
const device = matchMedia(SCHEME);
const rules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]);
/** @type {any} */
const dark = rules.find((rule) => rule instanceof CSSMediaRule && rule.conditionText === SCHEME);
const watchers = new Set();

/** What was chosen: "auto", "light" or "dark". */
export function theme() {
  const kept = localStorage.getItem(KEPT);
  return THEMES.includes(kept) ? kept : "auto";
}

export function setTheme(name) {
  localStorage.setItem(KEPT, name);
  apply();
  watchers.forEach((changed) => changed());
}

/** Calls `changed` whenever the colours are others than before; gives back how to stop. */
export function watchTheme(changed) {
  watchers.add(changed);
  device.addEventListener("change", changed);
  return () => {
    watchers.delete(changed);
    device.removeEventListener("change", changed);
  };
}

function apply() {
  const chosen = theme();
  if (dark) dark.media.mediaText = HOLDS[chosen];
  document.documentElement.style.colorScheme = chosen === "auto" ? "" : chosen;
}

apply();
