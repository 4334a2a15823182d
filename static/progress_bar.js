/** A progress bar with words beside it, and a button that stops what goes on where it can be stopped. */
import { h } from "./dom.js";

export function progressBar(label, stop = null, stopWords = "") {
  const fill = h("span", {});
  const bar = h("div", { class: "bar", role: "progressbar", "aria-label": label, "aria-valuemin": 0, "aria-valuemax": 100 }, fill);
  const words = h("p", { class: "small soft" });
  const button = stop && h("button", { type: "button", class: "small", onclick: stop }, stopWords);
  return {
    element: h("div", {}, bar, words, button ?? []),
    set(share, text = "", stoppable = true) {
      const percent = Math.round(100 * share);
      if (bar.getAttribute("aria-valuenow") !== String(percent)) {
        bar.setAttribute("aria-valuenow", percent);
        fill.style.transform = `scaleX(${percent / 100})`; // moved, not laid out anew
      }
      if (words.textContent !== text) words.textContent = text;
      if (button) button.hidden = !stoppable;
    },
  };
}
