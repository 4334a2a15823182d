/** The two choices that belong to the browser and not to the patient: language and light or dark. */
import { h } from "./dom.js";
import { field } from "./forms.js";
import { setTheme, theme, THEMES } from "./theme.js";
import { choose, language, LANGUAGES } from "./words/languages.js";
import { t } from "./words/words.js";

export function preferences() {
  return h(
    "div",
    { class: "preferences" },
    chooser(t("nav.language"), Object.entries(LANGUAGES), language, choose),
    chooser(
      t("nav.theme"),
      THEMES.map((name) => [name, t(`theme.${name}`)]),
      theme(),
      setTheme,
    ),
  );
}

function chooser(label, options, now, chosen) {
  const each = options.map(([value, words]) => h("option", { value, selected: value === now }, words));
  return field(label, h("select", { onchange: (event) => chosen(event.target.value) }, each));
}
