/** What was done to the hand, as a list with its days and a form for more; each stands as a line in the plots. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit, select } from "../forms.js";
import { day, t } from "../words/words.js";

const KINDS = ["operation", "botulinum_toxin", "splint", "therapy", "injury", "other"];
const SIDES = ["left", "right", "both"];
const LONGEST = 200;

export function drawTreatment(root, api, { patient, events, treats, reload }) {
  const box = errorBox();
  const rows = events.map((event, k) => row(event, k + 1));
  const nothing = h("p", { class: "soft" }, t("treatment.none"));
  root.replaceChildren(
    h("h3", {}, t("treatment.title")),
    rows.length ? h("ol", { class: "treatment-list" }, rows) : nothing,
    box.element,
    treats ? form() : "",
  );

  function row(event, number) {
    const remove = h("button", { type: "button", class: "plain" }, t("treatment.remove"));
    const erase = () => api.remove(`/api/treatment-events/${event.id}`).then(reload);
    remove.addEventListener("click", () => once(remove, box, erase));
    const named = t("treatment.row", { what: t(`treatment.${event.kind}`), side: t(`treatment.side.${event.hand}`), day: day(event.day) });
    return h(
      "li",
      { value: number },
      h("div", {}, h("span", {}, h("strong", {}, named), event.comment && ` ${event.comment}`), treats && remove),
    );
  }

  function form() {
    const kind = select(KINDS.map((name) => [name, t(`treatment.${name}`)]), KINDS[0]); // prettier-ignore
    const side = select(SIDES.map((name) => [name, t(`treatment.side.${name}`)]), SIDES[0]); // prettier-ignore
    const when = h("input", { type: "date", required: true, max: new Date().toLocaleDateString("sv") });
    const comment = h("input", { maxlength: LONGEST, autocomplete: "off" });
    const fields = h(
      "form",
      { class: "treatment-form" },
      field(t("treatment.what"), kind),
      field(t("course.hand"), side),
      field(t("treatment.day"), when),
      field(t("treatment.comment"), comment, t("notes.hint")),
      h("div", { class: "buttons" }, h("button", { type: "submit" }, t("treatment.add"))),
    );
    onSubmit(fields, box, async () => {
      const body = { kind: kind.value, hand: side.value, day: when.value, comment: comment.value };
      await api.post(`/api/patients/${patient}/treatment-events`, body);
      await reload();
    });
    return h("details", {}, h("summary", {}, t("treatment.note")), fields);
  }
}
