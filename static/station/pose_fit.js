/** In the initial pose: how well the palm and each finger are inclined as the blue hand, in words and colour. */
import { h, icon, whenChanged } from "../dom.js";
import { t } from "../words/words.js";

const COLOUR = { good: "good", fair: "", poor: "warn" };

export function mount(root, api, { station }) {
  const list = h("dl", { class: "fit" });
  root.append(h("h3", {}, t("fit.title")), list, h("p", { class: "soft small" }, t("fit.unseen")));
  const draw = whenChanged(
    ({ pose_fit }) => pose_fit,
    (parts) => {
      root.hidden = !parts.length;
      list.replaceChildren(...parts.map(line));
    },
  );
  return station.on("full", draw);
}

function line(fit) {
  const fits = [icon("check"), h("span", {}, t("fit.good"))];
  const words = h("span", { class: `badge ${COLOUR[fit.grade]}` }, fit.grade === "good" ? fits : offWords(fit));
  return h("div", { "data-part": fit.part, "data-grade": fit.grade }, h("dt", {}, t(`part.${fit.part}`)), h("dd", {}, words));
}

/** What a part does otherwise than the pose. */
export function offWords({ direction, deg }) {
  return t(`fit.${direction}`, { deg });
}
