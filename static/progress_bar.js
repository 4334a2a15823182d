/** A progress bar with words beside it. */
import { h } from "./dom.js";

export function progressBar(label) {
  const fill = h("span", {});
  const bar = h("div", { class: "bar", role: "progressbar", "aria-label": label, "aria-valuemin": 0, "aria-valuemax": 100 }, fill);
  const words = h("p", { class: "small soft" });
  return {
    element: h("div", {}, bar, words),
    set(share, text = "") {
      const percent = Math.round(100 * share);
      if (bar.getAttribute("aria-valuenow") !== String(percent)) {
        bar.setAttribute("aria-valuenow", percent);
        fill.style.width = `${percent}%`;
      }
      if (words.textContent !== text) words.textContent = text;
    },
  };
}
