/** Second factors of the own account: authenticators, passkeys, recovery codes. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit } from "../forms.js";
import * as passkey from "../login/passkey.js";
import { day, t, whole } from "../words/words.js";

const PLACE = "/api/me/second-factors";

export function mount(root, api, { made }) {
  const box = errorBox();
  const body = h("div", {});
  const codes = h("div", { role: "status", class: "handed" });
  root.append(h("h2", {}, t("second.title")), body, box.element, codes);
  let gone = false;
  draw();

  async function draw() {
    const state = await api.get(PLACE).catch(box.show);
    if (gone || !state) return;
    const why = h("p", { class: "soft" }, t("second.lead"));
    const needed = state.required && !state.factors.length && h("p", { class: "warning", role: "status" }, t("second.required"));
    const rows = state.factors.map((factor) => h("li", {}, h("span", {}, factorWords(factor)), remover(factor)));
    const left = state.factors.length > 0 && h("p", {}, t("second.codes_left", { count: whole(state.recovery_codes) }));
    body.replaceChildren(needed || "", why, rows.length ? h("ul", { class: "factors" }, rows) : "", left || "", actions(state));
  }

  function actions(state) {
    const open = (word, form) => h("button", { onclick: () => body.replaceChildren(form()) }, t(word));
    return h(
      "div",
      { class: "buttons" },
      open("second.add_app", appForm),
      state.passkeys && passkey.offered() && open("second.add_passkey", passkeyForm),
      state.factors.length > 0 && open("second.new_codes", codesForm),
    );
  }

  function remover(factor) {
    const remove = (given) => api.post(`${PLACE}/${factor.id}/removal`, given);
    return h("button", { onclick: () => body.replaceChildren(confirmed("second.remove", [], remove)) }, t("second.remove"));
  }

  /** A form that asks for the password before it does `work`, which gives recovery codes, the next step, or nothing. */
  function confirmed(word, fields, work) {
    const password = h("input", { type: "password", autocomplete: "current-password", maxlength: 256 });
    const send = h("button", { class: "primary", type: "submit" }, t(word));
    const cancel = h("button", { type: "button", onclick: () => (box.clear(), draw()) }, t("cancel"));
    const buttons = h("div", { class: "buttons" }, send, cancel);
    const form = h("form", { novalidate: true }, fields, field(t("second.password"), password), buttons);
    onSubmit(form, box, async () => done(await work({ password: password.value })));
    return form;
  }

  function done(answer) {
    box.clear();
    if (answer?.step) return body.replaceChildren(answer.step);
    if (answer?.recovery_codes?.length) showCodes(answer.recovery_codes);
    made();
    return draw();
  }

  function showCodes(list) {
    const items = list.map((code) => h("li", {}, h("code", {}, code)));
    codes.replaceChildren(h("h3", {}, t("second.codes")), h("p", {}, t("second.codes_lead")), h("ul", { class: "codes" }, items));
  }

  const named = (word) => h("input", { maxlength: 64, autocomplete: "off", value: t(word) });
  const codesForm = () => confirmed("second.new_codes", [], (given) => api.post("/api/me/recovery-codes", given));

  function appForm() {
    const name = named("second.app_name");
    return confirmed("second.next", [field(t("second.name"), name)], async (given) => {
      const begun = await api.post(`${PLACE}/totp`, { ...given, name: name.value });
      return { step: appStep(begun) };
    });
  }

  function appStep({ secret, picture }) {
    const code = h("input", { autocomplete: "one-time-code", inputmode: "numeric", maxlength: 10 });
    const send = h("button", { class: "primary", type: "submit" }, t("second.confirm"));
    const form = h(
      "form",
      { novalidate: true },
      h("p", {}, t("second.scan")),
      h("img", { class: "qr", src: picture, alt: t("second.qr") }),
      h("p", { class: "soft" }, t("second.by_hand"), " ", h("code", {}, secret)),
      field(t("second.code"), code),
      h("div", { class: "buttons" }, send, h("button", { type: "button", onclick: () => (box.clear(), draw()) }, t("cancel"))),
    );
    onSubmit(form, box, async () => done(await api.post(`${PLACE}/totp/confirmation`, { code: code.value })));
    return form;
  }

  function passkeyForm() {
    const name = named("second.passkey_name");
    return confirmed("second.add_passkey", [field(t("second.name"), name)], async (given) => {
      const { ticket, options } = await api.post(`${PLACE}/passkey`, given);
      const credential = await passkey.make(options).catch(() => null);
      if (!credential) throw new Error(t("second.passkey_failed"));
      return api.post(`${PLACE}/passkey/confirmation`, { ticket, name: name.value, credential });
    });
  }

  return () => {
    gone = true;
  };
}

function factorWords(factor) {
  const used = factor.used ? t("second.used", { day: day(factor.used) }) : t("second.never_used");
  return `${factor.name} · ${t(`second.kind.${factor.kind}`)} · ${used}`;
}
