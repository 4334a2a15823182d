/** All wards, for administrators of the whole house: new ones, other names, removed. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { loadWards } from "../patient/ward_names.js";
import { t } from "../words/words.js";

/** `changed` is called whenever there are other wards than before. */
export function mount(root, api, { changed }) {
  const box = errorBox();
  const rows = h("ul", { class: "notes" });
  const name = h("input", { autocomplete: "off", maxlength: 64 });
  const form = h(
    "form",
    { novalidate: true },
    field(t("ward.new"), name),
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("ward.make"))),
  );

  async function draw() {
    const wards = await loadWards(api);
    rows.replaceChildren(...wards.map(one));
    await changed(wards);
  }

  function one(ward) {
    if (ward.house) return h("li", {}, ward.name, h("p", { class: "hint" }, t("ward.all.note")));
    const other = h("input", { value: ward.name, maxlength: 64, "aria-label": t("ward.name"), autocomplete: "off" });
    const act = (word, work) => {
      const button = h("button", { type: "button", onclick: () => once(button, box, () => work().then(draw)) }, t(word));
      return button;
    };
    const rename = act("ward.rename", () => api.patch(`/api/wards/${ward.id}`, { name: other.value }));
    const remove = act("ward.remove", () => api.remove(`/api/wards/${ward.id}`));
    return h("li", {}, h("div", { class: "buttons" }, other, rename, remove));
  }

  onSubmit(form, box, async () => {
    await api.post("/api/wards", { name: name.value });
    form.reset();
    await draw();
  });
  root.append(h("h2", {}, t("ward.title")), h("p", { class: "soft" }, t("ward.lead")), rows, box.element, form);
  draw().catch(box.show);
  return () => root.replaceChildren();
}
