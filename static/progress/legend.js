/** What the small plots' marks mean, and where the bands and references come from. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

export function legend(payload, chosen, shown) {
  const other = Object.keys(payload.sessions).find((hand) => hand !== chosen.hand);
  const row = (kind, words) => h("li", {}, h("span", { class: `key key-${kind}`, "aria-hidden": "true" }), words);
  return [
    h(
      "ul",
      { class: "legend" },
      row("own", t(`hand.${chosen.hand}.title`)),
      other && row("other", t("course.other", { hand: t(`hand.${other}.title`) })),
      row("band", t(`course.band.${chosen.against}`)),
      row("beyond", t("course.beyond.mark")),
      shown.some((series) => series.reference) && row("reference", t("course.reference")),
      shown.some((series) => series.goals[chosen.hand]) && row("goal", t("course.goal.mark")),
      payload.treatment_events.length > 0 && row("event", t("course.event.mark")),
    ),
  ];
}

export function sources(payload, shown, chosen) {
  const sentences = shown.flatMap((series) => payload.judges[series.hands[chosen.hand].judge].sources);
  const references = shown.filter((series) => series.reference).map((series) => series.reference.source);
  const named = [...new Set(references)].join(", ");
  return [
    h("p", { class: "hint" }, [...new Set(sentences)].join(" "), " ", t("course.chance")),
    named && h("p", { class: "hint" }, t("course.reference.source", { names: named })),
  ].filter(Boolean);
}
