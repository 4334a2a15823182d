/** A label on the drawn hand while it is not followed yet. */
import { h, whenChanged } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { station }) {
  root.setAttribute("role", "status");
  const draw = whenChanged(
    ({ followed, glove }) => [followed, glove.flowing],
    ([followed, flowing]) => {
      root.hidden = followed;
      const known = flowing && h("span", { class: "small" }, t("following.known"));
      root.replaceChildren(...[h("strong", {}, t("following.not_yet")), known].filter(Boolean));
    },
  );
  return station.on("full", draw);
}
