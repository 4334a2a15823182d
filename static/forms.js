/** Parts of forms: a labelled field, choices, the place where an error is said, sending. */
import { h } from "./dom.js";

let count = 0;

/** A label, its control and a hint below; the control is given as an element. */
export function field(label, control, hint = "") {
  const id = `field-${(count += 1)}`;
  control.id = id;
  if (hint) control.setAttribute("aria-describedby", `${id}-hint`);
  return h("div", { class: "field" }, h("label", { for: id }, label), control, hint && h("p", { class: "hint", id: `${id}-hint` }, hint));
}

/** Radio buttons as large targets; `options` are { value, label, note, checked, disabled }. */
export function choices(legend, name, options, kind = "") {
  const rows = options.map((o) =>
    h(
      "label",
      { class: "choice" },
      h("input", { type: "radio", name, value: o.value, checked: o.checked, disabled: o.disabled, required: true }),
      h("span", {}, o.label, o.note && h("small", {}, o.note)),
    ),
  );
  return h("fieldset", { class: "field" }, h("legend", {}, legend), h("div", { class: `choices ${kind}` }, rows));
}

export function select(options, value, attributes = {}) {
  const rows = options.map(([key, text]) => h("option", { value: key, selected: key === value }, text));
  return h("select", attributes, rows);
}

/** The method that is taken unless another is asked for. */
export function initial(methods) {
  return (methods.find((method) => method.default) ?? methods[0]).name;
}

/** Where an error is said: nothing until `show`. */
export function errorBox() {
  const element = h("div", { role: "alert" });
  return {
    element,
    show: (error, ...more) => element.replaceChildren(h("div", { class: "error" }, h("p", {}, String(error.message ?? error)), more)),
    warn: (...parts) => element.replaceChildren(h("div", { class: "warning" }, parts)),
    clear: () => element.replaceChildren(),
  };
}

/** Have `send` do a form's work: once at a time, with its error said in `box`. */
export function onSubmit(form, box, send) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    await once(form.querySelector("[type=submit]"), box, send);
  });
}

const busy = new WeakSet();

/** Do `work` with a button out of use meanwhile; it is not disabled, because that would take the keyboard's focus away from it. */
export async function once(button, box, work) {
  if (busy.has(button)) return;
  busy.add(button);
  button.setAttribute("aria-busy", "true");
  box.clear();
  try {
    await work();
  } catch (error) {
    box.show(error);
  } finally {
    busy.delete(button);
    button.removeAttribute("aria-busy");
  }
}
