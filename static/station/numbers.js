/** Live numbers of the task that runs or was just done. */
import { h, whenChanged } from "../dom.js";
import { valueWords } from "../words/clinical.js";
import { decimal, known, t } from "../words/words.js";

export function mount(root, api, { station }) {
  const list = h("dl", {});
  root.append(list);
  const draw = whenChanged(
    ({ numbers, curve, wizard }) => [numbers, curve.what, wizard.state],
    ([numbers, what, state]) => {
      const rows = numbers.map((n) =>
        h(
          "div",
          {},
          h("dt", {}, known(`number.${what}.${n.name}`, null) ?? t(`number.${n.name}`)),
          h("dd", {}, n.sd ? t("number.sure", sure(n)) : n.unit ? valueWords(what, n.value) : String(n.value)),
        ),
      );
      list.hidden = !rows.length;
      list.replaceChildren(...rows);
      root.dataset.state = state;
    },
  );
  return station.on("full", draw);
}

/** A value and its standard deviation with significant decimals. */
function sure({ value, sd, unit }) {
  const digits = unit === "cm" ? 1 : 2;
  return { value: decimal(value, digits), sd: decimal(Math.max(sd, 10 ** -digits), digits), unit };
}
