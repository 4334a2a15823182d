/** What the figures are compared with: chosen when the result was made; another choice is a new version, the older ones stay. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit, once, select } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api, { session, result, go }) {
  const { references } = result;
  const box = errorBox();
  const other = session.hand === "left" ? "right" : "left";
  const place = h("div", {});
  const change = h("button", { class: "clinicians", "aria-expanded": "false", onclick: toggle }, t("references.change"));
  root.append(
    h("h2", {}, t("references.title")),
    h("ul", { class: "plain-list" }, h("li", {}, beforeWords(references.before)), h("li", {}, otherWords(references.other, other))),
    ...(references.same_visit ? [newer(references.same_visit)] : []),
    h("p", { class: "hint" }, madeWords(references)),
    ...(references.versions.length > 1 ? [field(t("references.version"), versionChoice())] : []),
    h("div", { class: "buttons" }, change),
    place,
    box.element,
  );

  /** The other hand was measured after this one: its result of the same visit is one press away. */
  function newer({ result: theirs, started }) {
    const compare = () => once(take, box, () => store(references.before?.result ?? null, theirs));
    const take = h("button", { class: "clinicians", onclick: compare }, t("references.same_visit.take"));
    return h("p", { class: "warning" }, t(`references.same_visit.${other}`, { moment: dayAndTime(started) }), " ", take);
  }

  async function store(before, across) {
    await api.post(`/api/results/${result.id}/references`, { before, other: across });
    show(null);
  }

  function versionChoice() {
    const rows = references.versions.map((v) => [String(v.number), t("references.row", { number: v.number, moment: dayAndTime(v.made) })]);
    const choice = select(rows, String(references.number), { onchange: () => show(choice.value) });
    return choice;
  }

  function show(number) {
    const asked = new URLSearchParams(location.search);
    asked.set("result", result.id);
    number === null ? asked.delete("references") : asked.set("references", number);
    go(`/sessions/${session.id}?${asked}`, true);
  }

  async function toggle() {
    const open = change.getAttribute("aria-expanded") !== "true";
    change.setAttribute("aria-expanded", String(open));
    place.replaceChildren();
    if (!open) return;
    try {
      draw(await api.get(`/api/results/${result.id}/references`));
    } catch (error) {
      box.show(error);
    }
  }

  function draw(candidates) {
    const rows = (hand) => candidates.filter((c) => c.hand === hand).map((c) => [String(c.result), dayAndTime(c.started)]);
    const nothing = ["", t("references.nothing")];
    const before = select([nothing, ...rows(session.hand)], String(references.before?.result ?? ""));
    const across = select([nothing, ...rows(other)], String(references.other?.result ?? ""));
    const send = h("button", { type: "submit", class: "primary" }, t("references.save"));
    const fields = [field(t("references.before"), before), field(t(`references.across.${other}`), across)];
    const form = h("form", {}, fields, send, h("p", { class: "hint" }, t("references.save.hint")));
    const chosen = (choice) => (choice.value ? Number(choice.value) : null);
    onSubmit(form, box, () => store(chosen(before), chosen(across)));
    place.replaceChildren(form);
  }

  return () => {};
}

function beforeWords(before) {
  return before ? t("references.since", { moment: dayAndTime(before.started) }) : t("references.no_before");
}

function otherWords(other, hand) {
  return other ? t(`references.against.${hand}`, { moment: dayAndTime(other.started) }) : t(`references.no_other.${hand}`);
}

function madeWords({ number, author, made, edition }) {
  const facts = { number, author, edition, moment: dayAndTime(made) };
  return t(author ? "references.made.person" : "references.made.program", facts);
}

/** The version of what a result is compared with, as an address names it. */
export function versionOf({ references }) {
  return references.number ? { references: references.number } : {};
}
