/** All accounts, for administrators: roles, one-time codes, in and out of use, new ones. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { memberships, wardBoxes } from "./memberships.js";
import { t } from "../words/words.js";

const ROLES = ["clinician", "scientist", "administrator"];

/** Gives `draw(wards)`, to be called with the hospital's wards, and how to `leave`. */
export function mount(root, api) {
  const box = errorBox();
  const codeBox = h("div", { role: "status", class: "handed" });
  const rows = h("tbody", {});
  const heads = h("tr", {});
  const wardPlace = h("div", {});
  let wards = []; // nothing about them is shown where there is but one
  let newWards = null;
  const name = h("input", { autocomplete: "off", maxlength: 64, spellcheck: "false" });
  const boxes = ROLES.map((role) => h("input", { type: "checkbox", value: role }));
  const choices = boxes.map((input) =>
    h("label", { class: "choice" }, input, h("span", {}, t(`role.${input.value}`), h("small", {}, t(`role.${input.value}.note`)))),
  );
  const form = h(
    "form",
    { novalidate: true },
    h("h3", {}, t("accounts.new")),
    field(t("accounts.name"), name, t("accounts.new_hint")),
    h("fieldset", { class: "field" }, h("legend", {}, t("accounts.roles")), h("div", { class: "choices" }, choices)),
    wardPlace,
    h("button", { class: "primary", type: "submit" }, t("accounts.make")),
  );

  async function draw(now = wards) {
    wards = now;
    const several = wards.length > 1;
    newWards = several ? wardBoxes(t("ward.of_account"), wards, []) : null;
    wardPlace.replaceChildren(...(newWards ? [newWards.element] : []));
    const words = ["accounts.name", "accounts.roles", several && "ward.title", "accounts.proof"].filter(Boolean);
    heads.replaceChildren(...words.map((word) => h("th", { scope: "col" }, t(word))), h("td", {}));
    const all = await api.get("/api/accounts");
    rows.replaceChildren(...all.map(one));
  }

  /** @param {import("../types/api.d.ts").AccountRow} account */
  function one(account) {
    const act = (word, work) => h("button", { onclick: (event) => once(event.target, box, work) }, t(word));
    const code = act("accounts.code", async () => handOver(account.name, (await api.post(`/api/accounts/${account.id}/code`)).code));
    const use = act(account.disabled ? "accounts.enable" : "accounts.disable", async () => {
      const wish = { version: account.version, disabled: !account.disabled };
      await api.patch(`/api/accounts/${account.id}`, wish).finally(draw); // refused: what another administrator made of it
    });
    const reset = act("accounts.reset", async () => {
      await api.remove(`/api/accounts/${account.id}/second-factors`);
      await draw();
    });
    const buttons = [!account.local && !account.disabled && code, account.second && reset, !account.local && use];
    return h(
      "tr",
      {},
      h("th", { scope: "row" }, account.name),
      h("td", { "data-column": t("accounts.roles") }, account.roles.map((role) => t(`role.${role}`)).join(", ")),
      wards.length > 1 && h("td", { "data-column": t("ward.title") }, memberships(api, account, wards, draw)),
      h("td", { "data-column": t("accounts.proof") }, proof(account)),
      h("td", {}, h("div", { class: "buttons" }, buttons)),
    );
  }

  function proof(account) {
    if (account.disabled) return t("accounts.disabled");
    return [t(`accounts.proof.${account.proof}`), account.second && t("accounts.second")].filter(Boolean).join(", ");
  }

  function handOver(whose, code) {
    codeBox.replaceChildren(h("p", {}, t("accounts.code_of", { name: whose })), h("p", {}, h("code", {}, code)));
  }

  onSubmit(form, box, async () => {
    const roles = boxes.filter((input) => input.checked).map((input) => input.value);
    const created = await api.post("/api/accounts", { name: name.value, roles, wards: newWards?.numbers() });
    form.reset();
    handOver(created.name, created.code);
    await draw();
  });
  const table = h("table", { class: "lined" }, h("thead", {}, heads), rows);
  const head = h("div", { class: "head" }, h("h2", {}, t("accounts.title")), h("a", { href: "/audit" }, t("nav.audit")));
  const wide = h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("accounts.title") }, table);
  root.append(head, box.element, wide, codeBox, form);
  return { draw, leave: () => root.replaceChildren() };
}
