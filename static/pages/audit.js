/** The audit trail, for administrators: lines, the newest first, and whether the chain holds. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { pages } from "../paging.js";
import { openedInEmergency } from "../patient/emergency.js";
import { counted, known, shortDayAndTime, t } from "../words/words.js";

const PAGE = 100;
const HEADS = ["when", "who", "what", "about", "patient", "where"];

export function mount(root, api, { title }) {
  title(t("audit.title"));
  const box = errorBox();
  const verdict = h("div", { role: "status" });
  const rows = h("tbody", {});
  const none = h("p", { class: "soft", hidden: true }, t("audit.none"));
  const who = h("input", { autocomplete: "off" });
  const patient = h("input", { inputmode: "numeric", autocomplete: "off" });
  const turning = h("div", {});
  let begins = [null]; // of each page the line that stands before its first: lines come in above, and move nothing
  const form = h(
    "form",
    { class: "buttons", novalidate: true },
    field(t("audit.who_only"), who),
    field(t("audit.patient_only"), patient),
    h("button", { type: "submit" }, t("audit.show")),
  );

  async function draw(offset = 0) {
    const page = offset / PAGE;
    if (!page) begins = [null];
    const query = new URLSearchParams({ limit: String(PAGE) });
    const wanted = { who: who.value.trim(), patient: patient.value.trim(), before: begins[page] };
    for (const [name, value] of Object.entries(wanted)) if (value) query.set(name, value);
    const found = await api.some(`/api/audit?${query}`);
    rows.replaceChildren(...found.rows.map(one));
    begins[page + 1] = found.rows.at(-1)?.id;
    turning.replaceChildren(pages(found, offset, PAGE, turn));
    none.hidden = found.rows.length > 0;
  }

  async function turn(to) {
    await draw(to).catch(box.show);
    section.scrollIntoView({ block: "nearest" });
    lines.focus({ preventScroll: true });
  }

  const verify = h("button", { onclick: () => once(verify, box, check) }, t("audit.verify"));

  async function check() {
    const { lines, last, broken } = await api.get("/api/audit/verification");
    const words = broken ? t("audit.broken", { broken }) : counted("audit.holds", lines, { last: last.slice(0, 16) });
    verdict.replaceChildren(h("p", { class: broken ? "error" : "soft" }, words));
  }

  const lines = h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("audit.title") }, table(rows));
  const section = h("section", { class: "card" }, form, lines, none, turning);
  onSubmit(form, box, () => draw());
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("audit.title")), h("p", { class: "soft" }, t("audit.lead"))), verify),
    box.element,
    verdict,
    section,
  );
  draw().catch(box.show);
  api.get("/api/emergency-accesses").then((all) => root.append(openedInEmergency(all) || ""), box.show);
  return () => root.replaceChildren();
}

/** A line as it is kept, in words; what has none is shown as `handscope audit list` prints it. */
function one({ id, at, who, what, kind, ref, patient, address, counts }) {
  const fields = (counts.fields ?? []).map((name) => known(`audit.field.${name}`, name)).join(", ");
  const about = [kind && known(`audit.kind.${kind}`, kind), ref, fields && `(${fields})`].filter(Boolean).join(" ");
  const cells = [who, known(`audit.does.${what.replaceAll(" ", "_")}`, what), about, patient ?? "", address];
  return h(
    "tr",
    { "data-id": id },
    h("th", { scope: "row" }, shortDayAndTime(at)),
    cells.map((text, k) => h("td", { "data-column": t(`audit.${HEADS[k + 1]}`), class: text === "" ? "none" : "" }, String(text))),
  );
}

function table(rows) {
  const head = HEADS.map((word) => h("th", { scope: "col" }, t(`audit.${word}`)));
  return h("table", { class: "audit lined" }, h("thead", {}, h("tr", {}, head)), rows);
}
