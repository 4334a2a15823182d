/** What a new session takes over of an earlier self-calibration of the hand: a question without an answer given beforehand. */
import { h } from "../dom.js";
import { choices } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

const PARTS = ["lengths_and_seats", "lengths", "nothing"];

export function mount(root, api, { kept }) {
  let offered = null; // the newest of the hand

  /** Ask about the newest of this hand, where there is one. */
  async function ask(hand) {
    await kept.loaded;
    offered = kept.now.filter((one) => one.hand === hand && !one.withdrawn).sort((a, b) => (a.recorded < b.recorded ? 1 : -1))[0] ?? null;
    const moment = offered && dayAndTime(offered.recorded);
    const options = PARTS.map((parts) => ({
      value: parts,
      label: t(`reuse.take.${parts}`),
      note: parts === "nothing" ? t("reuse.nothing.note") : t(`reuse.${parts}.note`, { moment }),
    }));
    const summary = offered && h("p", { class: "soft small" }, offered.tables.summary);
    root.replaceChildren(...(offered ? [choices(t("reuse.of", { moment }), "reuse", options, "several"), summary] : []));
  }

  /** What was decided, as the API takes it; an Error where it was not. */
  async function decision() {
    await kept.loaded;
    if (!offered) return null;
    const parts = root.querySelector("input:checked")?.value;
    if (!parts) throw new Error(t("reuse.which"));
    return { parts, self_calibration: parts === "nothing" ? null : offered.id };
  }

  return { ask, decision };
}
