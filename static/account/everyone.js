/** All accounts, for administrators: roles, one-time codes, in and out of use, new ones. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { t } from "../words/words.js";

const ROLES = ["clinician", "scientist", "administrator"];

export function mount(root, api) {
  const box = errorBox();
  const codeBox = h("div", { role: "status", class: "handed" });
  const rows = h("tbody", {});
  const heads = ["accounts.name", "accounts.roles", "accounts.proof"].map((word) => h("th", { scope: "col" }, t(word)));
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
    h("button", { class: "primary", type: "submit" }, t("accounts.make")),
  );

  async function draw() {
    const all = await api.get("/api/accounts");
    rows.replaceChildren(...all.map(one));
  }

  /** @param {import("../types/api.d.ts").AccountRow} account */
  function one(account) {
    const act = (word, work) => h("button", { onclick: (event) => once(event.target, box, work) }, t(word));
    const code = act("accounts.code", async () => handOver(account.name, (await api.post(`/api/accounts/${account.id}/code`)).code));
    const use = act(account.disabled ? "accounts.enable" : "accounts.disable", async () => {
      await api.patch(`/api/accounts/${account.id}`, { disabled: !account.disabled });
      await draw();
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
      h("td", {}, account.roles.map((role) => t(`role.${role}`)).join(", ")),
      h("td", {}, proof(account)),
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
    const created = await api.post("/api/accounts", { name: name.value, roles });
    form.reset();
    handOver(created.name, created.code);
    await draw();
  });
  const table = h("table", {}, h("thead", {}, h("tr", {}, heads, h("td", {}))), rows);
  const head = h("div", { class: "head" }, h("h2", {}, t("accounts.title")), h("a", { href: "/audit" }, t("nav.audit")));
  root.append(head, box.element, table, codeBox, form);
  api.get("/api/me").then((me) => me.roles.includes("administrator") && draw().catch(box.show), box.show);
  return () => root.replaceChildren();
}
