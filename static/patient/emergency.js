/** Emergency access to a patient of another ward: opened by the code with a reason; and who opened whose patients. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { loadWards } from "./ward_names.js";
import { dayAndTime, t } from "../words/words.js";

/** On the page of all patients: nothing where every ward is one's own and nobody opened anything. */
export function mount(root, api, { go }) {
  let gone = false;
  const box = errorBox();

  async function draw() {
    const wards = await loadWards(api);
    if (gone || wards.length < 2) return;
    const [own, others] = await Promise.all([api.get("/api/emergency-accesses?own=true"), api.get("/api/emergency-accesses")]);
    if (gone) return;
    const parts = [
      wards.some((ward) => !ward.own && !ward.house) && h("section", { class: "card" }, opening(api, go), own.map(mine)),
      openedInEmergency(others),
    ].filter(Boolean);
    root.replaceChildren(...parts, box.element);
  }

  function mine(access) {
    const end = h("button", { onclick: () => once(end, box, () => api.remove(`/api/emergency-accesses/${access.id}`).then(draw)) });
    end.append(t("emergency.end"));
    const link = h("a", { href: `/patients/${access.patient}` }, access.pseudonym);
    return h("p", { class: "buttons" }, link, h("span", { class: "soft" }, t("emergency.until", { when: dayAndTime(access.ends) })), end);
  }

  draw().catch(box.show);
  return () => {
    gone = true;
    root.replaceChildren();
  };
}

function opening(api, go) {
  const box = errorBox();
  const code = h("input", { autocomplete: "off", spellcheck: "false", maxlength: 64 });
  const reason = h("textarea", { maxlength: 1000, rows: 3 });
  const form = h(
    "form",
    { novalidate: true },
    h("p", {}, t("emergency.lead")),
    field(t("fact.pseudonym"), code),
    field(t("emergency.reason"), reason, t("emergency.reason.hint")),
    box.element,
    h("button", { class: "danger", type: "submit" }, t("emergency.open")),
  );
  onSubmit(form, box, async () => {
    const access = await api.post("/api/emergency-accesses", { pseudonym: code.value, reason: reason.value });
    go(`/patients/${access.patient}`);
  });
  return h("details", {}, h("summary", {}, h("h2", {}, t("emergency.title"))), form);
}

/**
 * Accesses, the newest first; nothing where there are none.
 * @param {import("../types/api.d.ts").EmergencyRow[]} accesses
 */
export function openedInEmergency(accesses) {
  if (!accesses.length) return false;
  return h("section", { class: "card" }, h("h2", {}, t("emergency.by_others")), h("ul", { class: "notes" }, accesses.map(one)));
}

function one({ by, patient, pseudonym, reason, begun, ends }) {
  const row = t("emergency.row", { who: by, code: pseudonym || patient, when: dayAndTime(begun), until: dayAndTime(ends) });
  return h("li", {}, h("p", { class: "text" }, reason), h("p", { class: "soft small" }, row));
}

/** On a patient's page: that one is here by an emergency access, with its end; null where one is not. */
export async function banner(api, patient, left) {
  if (!patient.emergency_accesses.some((access) => access.lasts)) return null;
  const own = await api.get("/api/emergency-accesses?own=true");
  const access = own.find((one) => one.patient === patient.id);
  if (!access) return null;
  const box = errorBox();
  const end = h("button", { onclick: () => once(end, box, () => api.remove(`/api/emergency-accesses/${access.id}`).then(left)) });
  end.append(t("emergency.end"));
  const words = t("emergency.here", { ward: patient.ward_name, when: dayAndTime(access.ends) });
  return h("div", { class: "warning", role: "status" }, h("p", {}, words), h("div", { class: "buttons" }, end), box.element);
}
