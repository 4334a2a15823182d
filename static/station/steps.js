/** The bar of steps: connect, initial pose, tasks, finish. */
import { h, icon, whenChanged } from "../dom.js";
import { known, t } from "../words/words.js";

export function mount(root, api, { station }) {
  const draw = whenChanged(
    (full) => [full.wizard.step, full.wizard.steps],
    ([now, steps]) => {
      const at = steps.findIndex((step) => step.name === now);
      const items = steps.map((step, k) => {
        const place = k < at ? "done" : k === at ? "now" : "later";
        const number = h("span", { class: "number", "aria-hidden": "true" }, place === "done" ? icon("check") : String(k + 1));
        return h(
          "li",
          { class: place, "aria-current": place === "now" && "step" },
          number,
          known(`step.${step.name}`, step.title),
          place === "done" && h("span", { class: "visually-hidden" }, t("step.done")),
        );
      });
      root.replaceChildren(h("ol", { "aria-label": t("step.label") }, items));
    },
  );
  return station.on("full", draw);
}
