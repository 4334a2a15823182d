/** Sessions of simulated patients that a demonstration makes still: how many are there, and what came is looked for again and again. */
import { h } from "../dom.js";
import { progressBar } from "../progress_bar.js";
import { t } from "../words/words.js";

const AGAIN_MS = 4000;

/** `look` reads anew what the page shows, which is then taken again. */
export function makeComing(look) {
  const bar = progressBar(t("coming.bar"));
  const element = h("div", { class: "note", hidden: true }, bar.element);
  let timer = 0;
  return {
    element,
    /** Of each patient shown how many sessions are there, and how many are planned (0 where no more come); whether some are to come. */
    take(patients) {
      const all = patients.reduce((sum, { planned }) => sum + planned, 0);
      const made = patients.reduce((sum, { sessions, planned }) => sum + Math.min(sessions, planned), 0);
      element.hidden = !all;
      if (all) bar.set(made / all, t("coming.made", { made, all }));
      clearTimeout(timer);
      if (all) timer = setTimeout(look, AGAIN_MS);
      return all > 0;
    },
    leave: () => clearTimeout(timer),
  };
}
