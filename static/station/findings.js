/** What the checks found at the sensors in what has come so far: which one, what is probably wrong, what to do. */
import { h, whenChanged } from "../dom.js";
import { inWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const MOVING = /_run$|_hold$|countdown/; // while somebody moves nothing is told that can wait

export function mount(root, api, { station }) {
  root.setAttribute("role", "status");
  const draw = whenChanged(
    ({ findings, wizard }) => (MOVING.test(wizard.state) ? findings.filter(({ severity }) => severity !== "info") : findings),
    (findings) => {
      root.hidden = !findings.length;
      root.replaceChildren(
        ...(findings.some(({ severity }) => severity !== "info") ? [h("h2", {}, t("findings.title"))] : []),
        ...findings.map(({ sentence, severity }) =>
          h("p", severity === "info" ? {} : { class: "warning" }, inWords(sentence)),
        ),
      );
    },
  );
  return station.on("full", draw);
}
