/** What the numbers say of the map, asked anew a moment after each change. */
import { h } from "../dom.js";
import { partWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const twice = (point, quantity) => t("table.twice", { point: partWords(point), quantity: t(`table.quantity.${quantity}`) });
const PAUSE = 400; // ms without a change

export function make(api, at) {
  const element = h("div", { "aria-live": "polite" });
  const watchers = new Set();
  let timer = 0;
  let turn = 0;

  async function ask(map) {
    const mine = (turn += 1);
    if (map.twice) return say(twice(...map.twice));
    if (!Object.keys(map.sensors).length) return say(t("table.nothing_mapped"));
    try {
      const found = await api.post(`${at}/check`, { map });
      if (mine !== turn) return undefined;
      watchers.forEach((watch) => watch(found));
      const rows = found.findings.map(({ severity, text }) => h("li", { class: severity }, text));
      return element.replaceChildren(h("ul", { class: "findings" }, rows));
    } catch (error) {
      return mine === turn && element.replaceChildren(h("p", { class: "error" }, error.message));
    }
  }

  const say = (words) => element.replaceChildren(h("p", { class: "soft" }, words));

  return {
    element,
    check: (map) => {
      clearTimeout(timer);
      timer = setTimeout(ask, PAUSE, map);
    },
    /** `watch` gets what was found, each time. */
    watch: (watch) => watchers.add(watch),
    stop: () => {
      clearTimeout(timer);
      turn += 1;
    },
  };
}
