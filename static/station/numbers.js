/** Live numbers of the task that runs or was just done. */
import { h, whenChanged, write } from "../dom.js";
import { valueWords } from "../words/clinical.js";
import { decimal, known, t } from "../words/words.js";

export function mount(root, api, { station }) {
  const list = h("dl", {});
  root.append(list);
  const draw = whenChanged(
    ({ numbers, curve, wizard }) => [numbers, curve.what, wizard.state],
    ([numbers, what, state]) => {
      const names = numbers.map((n) => known(`number.${what}.${n.name}`, null) ?? t(`number.${n.name}`));
      arrange(names);
      numbers.forEach((n, k) => write(list.children[k].lastChild, valueOf(n, what)));
      list.hidden = !numbers.length;
      root.dataset.state = state;
    },
  );
  const arrange = whenChanged(
    (names) => names,
    (names) => list.replaceChildren(...names.map((name) => h("div", {}, h("dt", {}, name), h("dd", {})))),
  );
  return station.on("full", draw);
}

const valueOf = (n, what) => (n.sd ? t("number.sure", sure(n)) : n.unit ? valueWords(what, n.value) : String(n.value));

/** A value and its standard deviation with significant decimals. */
function sure({ value, sd, unit }) {
  const digits = unit === "cm" ? 1 : 2;
  return { value: decimal(value, digits), sd: decimal(Math.max(sd, 10 ** -digits), digits), unit };
}
