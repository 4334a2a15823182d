/** The clinician's own score of the trial under review, where its task asks for one: a row of numbers to press; it may be left out. */
import { h, whenChanged } from "../dom.js";
import { t } from "../words/words.js";

export function mount(root, api, { station, given }) {
  const draw = whenChanged(
    ({ wizard }) => [wizard.score, wizard.state, wizard.task, wizard.pace?.trial],
    ([asked]) => {
      given.score = null;
      root.hidden = !asked;
      root.replaceChildren(...(asked ? [row(asked)] : []));
    },
  );

  function row({ title, least, most, hint }) {
    const choices = Array.from({ length: most - least + 1 }, (_, k) => least + k);
    const boxes = choices.map((value) => {
      const box = h("input", { type: "radio", name: "score", value, onchange: () => (given.score = value) });
      return h("label", { class: "choice" }, box, String(value));
    });
    return h(
      "fieldset",
      {},
      h("legend", {}, t("score.legend", { title })),
      h("div", { class: "scores" }, boxes),
      h("p", { class: "soft small" }, `${hint} ${t("score.optional")}`.trim()),
    );
  }

  return station.on("full", draw);
}
