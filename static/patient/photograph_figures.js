/** What a photograph told, with standard deviations. */
import { h } from "../dom.js";
import { jointWords, segmentWords } from "../words/clinical.js";
import { decimal, t } from "../words/words.js";

/** `rows` are { what, value, sd, unit }: a segment's length, or a joint's deviation. */
export function figuresTable(rows) {
  const head = ["what", "value", "sd"].map((name) => h("th", { scope: "col" }, t(`photograph.${name}`)));
  const lines = rows.map(({ what, value, sd, unit }) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, words(what)),
      h("td", { class: "number" }, `${decimal(value, 1)} ${unit}`),
      h("td", { class: "number" }, `± ${decimal(sd, 1)} ${unit}`),
    ),
  );
  return h("table", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, lines));
}

function words(what) {
  if (what === "hand") return t("photograph.palm");
  const joint = what.match(/^(.*)_deviation$/)?.[1];
  return joint ? t("photograph.deviation", { joint: Object.values(jointWords(joint)).join(" ").trim() }) : segmentWords(what);
}
