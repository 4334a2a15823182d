/** What self-calibration found, to be kept with the patient; and what this session takes over of an earlier one, as somebody decides. */
import { h } from "../dom.js";
import { choices, errorBox, onSubmit, once } from "../forms.js";
import { foundTables } from "../self_calibration_tables.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api, { session, result, reload }) {
  const box = errorBox();
  const found = h("div", {});
  const decided = h("div", {});
  const list = `/api/patients/${session.patient.id}/self-calibrations`;
  let gone = false;
  root.hidden = true;
  root.append(h("h2", {}, t("found.title")), found, decided, box.element);

  async function load() {
    const [kept, reuse] = await Promise.all([api.get(list), api.get(`/api/sessions/${session.id}/reuse`)]);
    if (gone) return;
    root.hidden = !result?.self_calibration && !reuse.offers.length && !reuse.decided;
    if (result?.self_calibration) drawFound(kept);
    if (reuse.offers.length || reuse.decided) drawReuse(reuse);
  }

  function drawFound(kept) {
    const have = kept.some((one) => one.recording === result.recording && one.onset === result.content.self_calibration.onset);
    const send = () => api.post(list, { result: result.id }).then(load);
    const keep = h("button", { class: "clinicians", onclick: () => once(keep, box, send) }, t("found.keep"));
    const more = have ? h("p", { class: "soft" }, t("found.kept")) : [h("p", { class: "soft" }, t("found.keep.note")), keep];
    found.replaceChildren(...[...foundTables(result.self_calibration), more].flat().filter(Boolean));
  }

  function drawReuse({ decided: now, offers }) {
    const said = now ? t(`reuse.now.${now.parts}`, { moment: momentOf(now, offers) }) : t("reuse.undecided");
    const options = offers.flatMap((offer) => offer.parts.map((parts) => option(offer, parts, now))).reverse();
    const nothing = { value: "nothing:", label: t("reuse.nothing"), checked: now?.parts === "nothing" };
    const form = h(
      "form",
      { novalidate: true },
      choices(t("reuse.choose"), "reuse", [...options, nothing], "several"),
      offers.filter((offer) => offer.barred).map((offer) => h("p", { class: "soft small" }, offer.barred)),
      h("p", { class: "clinicians" }, h("button", { type: "submit" }, t("reuse.save"))),
    );
    onSubmit(form, box, async () => {
      const chosen = form.querySelector("input:checked")?.value;
      if (!chosen) throw new Error(t("reuse.which"));
      const [parts, id] = chosen.split(":");
      await api.put(`/api/sessions/${session.id}/reuse`, { parts, self_calibration: id ? Number(id) : null });
      if (!gone) reload();
    });
    const taken = now && offers.find((offer) => offer.id === now.self_calibration);
    const shown = taken && foundTables(now.parts === "lengths" ? { ...taken.tables, seats: [], biases: [] } : taken.tables);
    const other = h("details", {}, h("summary", {}, t("reuse.change")), form);
    decided.replaceChildren(...[h("h3", {}, t("reuse.title")), h("p", {}, said), shown, other].flat().filter(Boolean));
  }

  load().catch((error) => gone || ((root.hidden = false), box.show(error)));
  return () => {
    gone = true;
  };
}

function option(offer, parts, now) {
  const moment = dayAndTime(offer.recorded);
  return {
    value: `${parts}:${offer.id}`,
    label: t(`reuse.${parts}`, { moment }),
    note: t(`reuse.${parts}.note`, { moment }),
    checked: now?.parts === parts && now?.self_calibration === offer.id,
  };
}

function momentOf(now, offers) {
  const offer = offers.find((one) => one.id === now.self_calibration);
  return offer ? dayAndTime(offer.recorded) : t("reuse.withdrawn");
}
