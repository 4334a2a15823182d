/** The wards of one account: which it belongs to, and which of them it heads. */
import { h } from "../dom.js";
import { errorBox, onSubmit } from "../forms.js";
import { t } from "../words/words.js";

/** Checkboxes for wards; `numbers()` of those that are ticked. */
export function wardBoxes(legend, wards, ticked) {
  const boxes = wards.map((ward) => h("input", { type: "checkbox", value: String(ward.id), checked: ticked.includes(ward.id) }));
  const labels = wards.map((ward, k) => h("label", { class: "choice" }, boxes[k], h("span", {}, ward.name)));
  return {
    element: h("fieldset", { class: "field" }, h("legend", {}, legend), h("div", { class: "choices" }, labels)),
    numbers: () => boxes.filter((box) => box.checked).map((box) => Number(box.value)),
  };
}

/**
 * What a row shows, with the form behind it.
 * @param {import("../types/api.d.ts").AccountRow} account
 */
export function memberships(api, account, wards, changed) {
  const of = (number) => wards.find((ward) => ward.id === number)?.name;
  const named = (m) => (m.head ? t("ward.headed", { ward: of(m.ward) ?? m.name }) : (of(m.ward) ?? m.name));
  const names = (row) => row.wards.map(named).join(", ") || t("ward.none");
  const box = errorBox();
  const numbers = (of) => of.map((m) => m.ward);
  const parts = wards.filter((ward) => !ward.house);
  const belongs = wardBoxes(t("ward.of_account"), wards, numbers(account.wards));
  const heads = wardBoxes(t("ward.heads"), parts, numbers(account.wards.filter((m) => m.head)));
  const form = h(
    "form",
    { novalidate: true },
    belongs.element,
    heads.element,
    box.element,
    h("button", { class: "primary", type: "submit" }, t("save")),
  );
  let seen = account;
  onSubmit(form, box, () => save());

  /** Where another administrator was faster with something else, both changes are kept; with the wards, the person compares. */
  async function save() {
    const wish = { version: seen.version, wards: belongs.numbers(), heads: heads.numbers() };
    try {
      await api.patch(`/api/accounts/${account.id}`, wish);
    } catch (error) {
      const stored = error.status === 409 && (await newest());
      if (!stored) throw error;
      const before = names(seen);
      seen = stored;
      if (names(stored) === before) return save();
      box.show(error, h("p", {}, t("ward.stored_now", { wards: names(stored) })));
      return;
    }
    await changed();
  }

  async function newest() {
    const all = await api.get("/api/accounts").catch(() => []);
    return all.find((other) => other.id === account.id);
  }

  return h("details", {}, h("summary", {}, names(account)), form);
}
