/** What a photograph told, with standard deviations. */
import { h } from "../dom.js";
import { directionWords, segmentWords, wholeJoint } from "../words/clinical.js";
import { decimal, t } from "../words/words.js";

const DEVIATION = /^(.*)_deviation$/;
const LEAST = 0.05; // degrees that are more than none

/** `rows` are { what, value, sd, unit }: a segment's length, or a joint's deviation. */
export function figuresTable(rows) {
  const head = ["what", "value"].map((name) => h("th", { scope: "col" }, t(`photograph.${name}`)));
  const lines = rows.map(({ what, value, sd, unit }) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, words(what)),
      h("td", { class: "number" }, size(value, sd, unit), " ", direction(what, value)),
    ),
  );
  return h("table", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, lines));
}

/** "83.3 ± 0.9 mm", "45.0° ± 0.8°", on one line. */
function size(value, sd, unit) {
  const [number, sure] = [Math.abs(value), sd].map((one) => decimal(one, 1));
  return (unit === "°" ? `${number}° ± ${sure}°` : `${number} ± ${sure} ${unit}`).replaceAll(" ", "\u00a0");
}

/** Which way a joint deviates; a length goes none. */
function direction(what, value) {
  const joint = what.match(DEVIATION)?.[1];
  return joint && Math.abs(value) >= LEAST ? directionWords(joint, "deviation", value > 0) : "";
}

function words(what) {
  if (what === "hand") return t("photograph.palm");
  const joint = what.match(DEVIATION)?.[1];
  return joint ? t("photograph.deviation", { joint: wholeJoint(joint) }) : segmentWords(what);
}
