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
  const own = account.wards.map((m) => (m.head ? t("ward.headed", { ward: of(m.ward) }) : of(m.ward)));
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
  onSubmit(form, box, async () => {
    await api.patch(`/api/accounts/${account.id}`, { wards: belongs.numbers(), heads: heads.numbers() });
    await changed();
  });
  return h("details", {}, h("summary", {}, own.join(", ") || t("ward.none")), form);
}
