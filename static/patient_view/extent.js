/** How far the movement goes now, how far it went in this trial, and the band that the demonstration reaches. */
import { h, hide } from "../dom.js";
import { t } from "../words/words.js";

const BEYOND = 1.25; // the bar ends so many times as far as the band
const LEAST = 20; // degrees or mm that the bar spans without a band

export function mount(root, api, { screen }) {
  const band = h("span", { class: "band" });
  const fill = h("span", { class: "fill" });
  const furthest = h("span", { class: "furthest" });
  const words = h("p", { class: "number" });
  const bar = h("div", { class: "reached" }, band, fill, furthest);
  root.setAttribute("aria-hidden", "true"); // a number with every picture: the words say what to do
  root.append(h("p", {}, t("screen.extent")), bar, words);
  let most = 0;

  function draw({ stage, value, target, unit }) {
    hide(root, stage !== "run" || value === null);
    if (root.hidden) {
      most = 0;
      return;
    }
    const sign = target && target[0] + target[1] < 0 ? -1 : 1;
    const reached = sign * value;
    most = Math.max(most, reached);
    const [from, to] = target ? target.map((edge) => sign * edge).sort((a, b) => a - b) : [null, 0];
    const whole = Math.max(LEAST, BEYOND * to, most);
    const share = (part) => `${(100 * Math.min(1, Math.max(0, part / whole))).toFixed(1)}%`;
    fill.style.width = share(reached);
    furthest.style.left = share(most);
    hide(band, from === null);
    if (!band.hidden) [band.style.left, band.style.width] = [share(from), share(to - from)];
    root.classList.toggle("there", from !== null && most >= from);
    words.textContent = unit === "mm" ? `${Math.round(value)} mm` : `${Math.round(reached)}°`;
  }

  return screen.on("state", draw);
}
