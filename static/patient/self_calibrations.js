/** The self-calibrations that are kept with the patient: what each found, and whether sessions to come are offered it. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { foundTables } from "../self_calibration_tables.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api, { kept, treats }) {
  const box = errorBox();
  const list = h("ol", { class: "notes" });
  let gone = false;
  root.hidden = true;
  root.append(h("h2", {}, t("kept.title")), list, box.element);

  function one(row) {
    const change = h("button", { type: "button", class: "plain", onclick: () => once(change, box, () => withdraw(row)) });
    change.textContent = t(row.withdrawn ? "kept.offer" : "kept.withdraw");
    return h(
      "li",
      { "data-id": row.id },
      h("p", { class: "text" }, t("kept.row", { moment: dayAndTime(row.recorded), hand: t(`hand.${row.hand}.title`) })),
      h("p", { class: "soft small" }, t(row.withdrawn ? "kept.withdrawn" : "kept.offered")),
      h("details", {}, h("summary", {}, t("kept.found")), foundTables(row.tables)),
      h("div", { class: "buttons" }, h("a", { href: `/sessions/${row.session}` }, t("kept.session")), treats && change),
    );
  }

  async function withdraw(row) {
    await kept.withdraw(row.id, !row.withdrawn);
    list.querySelector(`[data-id="${row.id}"] button`)?.focus();
  }

  const stop = kept.watch((rows) => {
    root.hidden = !rows.length;
    list.replaceChildren(...rows.map(one));
  });
  kept.loaded.catch((error) => gone || ((root.hidden = false), box.show(error)));
  return () => {
    gone = true;
    stop();
  };
}
