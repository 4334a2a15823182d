/** How high above the hips the trunk's sensor was worn: corrected afterwards, and what was computed with it is computed anew. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit, once } from "../forms.js";
import { metres, millimetres } from "../patient/lengths.js";
import { sendChange } from "../patient/record.js";
import { t } from "../words/words.js";

export const worn = ({ recordings }) => recordings.some(({ summary }) => summary.streams?.some(({ sensors }) => sensors.includes("trunk")));

export function mount(root, api, { record, draft, result, recomputed }) {
  const box = errorBox();
  const words = h("p", {});
  const typed = () => (draft.trunk = input.value); // stays when the page draws itself anew
  const input = h("input", { inputmode: "decimal", autocomplete: "off", name: "trunk_height", required: true, oninput: typed });
  const form = h(
    "form",
    { novalidate: true },
    h("p", { class: "hint" }, t("trunk.how")),
    field(t("measure.trunk_height"), input),
    h("div", { class: "buttons" }, h("button", { class: "primary", type: "submit" }, t("trunk.send"))),
  );
  const back = h("button", { type: "button" }, t("trunk.back"));
  const details = h("details", { open: draft.trunk !== undefined }, h("summary", {}, t("trunk.correct")), form, back);
  root.append(h("h2", {}, t("fact.trunk_height")), words, details, box.element);
  const recorded = result?.content?.events?.find((event) => event.trunk_height)?.trunk_height;

  async function send(trunk_height) {
    const stored = (now, mine) => {
      delete draft.trunk;
      show(now);
      return recomputed(mine ? now.results : []); // somebody else's height had what was computed made anew as well
    };
    if (await sendChange(record, { trunk_height }, box, stored)) await stored(record.now, true);
  }

  back.onclick = () => once(back, box, () => send(null));
  onSubmit(form, box, async () => {
    const height = metres(input.value, t("measure.trunk_height"));
    if (height === null) throw new Error(t("trunk.missing"));
    await send(height);
  });

  function show({ trunk_height: stored, trunk_corrected: corrected, state }) {
    root.hidden = state === "open";
    const height = stored ?? (recorded ? Number(recorded) : null);
    const key = height === null ? "trunk.unknown" : corrected ? "trunk.corrected" : "trunk.measured";
    words.textContent = t(key, { mm: millimetres(height) });
    input.value = draft.trunk ?? millimetres(height);
    back.hidden = !corrected;
  }

  show(record.now);
  return record.watch(show);
}
