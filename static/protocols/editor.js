/** A protocol with its fields; saving stores the next version, and the older ones stay. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";
import { taskRows } from "./task_rows.js";

const EMPTY = { title: "", note: "", sources: [], tasks: [] };
const LONGEST = { title: 300, note: 600 };

export function editor(api, { plan, plans, tasks, stored }) {
  const box = errorBox();
  const content = plan?.content ?? EMPTY;
  const title = h("input", { value: content.title, required: true, maxlength: LONGEST.title, autocomplete: "off" });
  const note = h("textarea", { value: content.note ?? "", maxlength: LONGEST.note });
  const sources = h("textarea", { value: content.sources.join("\n"), required: true });
  const rows = taskRows(content.tasks, tasks);
  const next = plan ? t("protocols.save", { version: plan.version + 1 }) : t("protocols.create");
  const save = h("button", { class: "primary", type: "submit" }, next);
  const form = h(
    "form",
    {},
    h("h2", {}, plan ? content.title : t("protocols.new")),
    plan?.stored && h("p", { class: "soft small" }, t("protocols.stored", { who: plan.author, when: dayAndTime(plan.stored) })),
    field(t("protocols.name"), title),
    field(t("protocols.note"), note, t("protocols.note.hint")),
    rows.element,
    field(t("protocols.sources"), sources, t("protocols.sources.hint")),
    box.element,
    h("div", { class: "buttons" }, save, ...(plan ? others() : [])),
  );
  onSubmit(form, box, async () => {
    const name = plan?.name ?? freeName(title.value, plans);
    const lines = sources.value.split("\n").map((line) => line.trim());
    const written = { title: title.value.trim(), note: note.value.trim(), sources: lines.filter(Boolean), tasks: rows.read() };
    await api.post("/api/assessment-plans", { content: { name, ...written }, seen: plan?.version ?? 0 });
    await stored(name);
  });

  function others() {
    const address = `/api/assessment-plans/${plan.name}`;
    const remove = h("button", { type: "button", class: "plain" }, t("protocols.remove"));
    remove.addEventListener("click", () => once(remove, box, () => api.remove(address).then(() => stored())));
    return [
      h("a", { class: "button", href: `${address}/file.json?version=${plan.version}`, download: "" }, t("protocols.export")),
      ...(plan.own ? [remove] : []),
    ];
  }
  return form;
}

/** A name of small letters for a file, from a title, that no protocol has. */
function freeName(title, plans) {
  const plain = title.normalize("NFD").toLowerCase().replace(/[^a-z0-9]+/g, "_"); // prettier-ignore
  const name = plain.replace(/^[^a-z]+|_+$/g, "").slice(0, 50) || "protocol";
  const taken = new Set(plans.map((plan) => plan.name));
  const numbers = Array.from({ length: taken.size + 1 }, (_, k) => (k ? `${name}_${k + 1}` : name));
  return numbers.find((one) => !taken.has(one));
}
