/** A session without any trial can be deleted where it stands; a second press says that it is meant. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { t } from "../words/words.js";

export function mount(root, api, { session, go }) {
  const box = errorBox();
  const erase = async () => {
    await api.remove(`/api/sessions/${session.id}`);
    go(`/patients/${session.patient.id}`, true);
  };
  const sure = h("button", { class: "danger", hidden: true, onclick: () => once(sure, box, erase) }, t("empty_session.sure"));
  const ask = h("button", { onclick: () => ((sure.hidden = false), (ask.hidden = true)) }, t("empty_session.delete"));
  const buttons = h("div", { class: "buttons" }, ask, sure);
  root.append(h("h2", {}, t("empty_session.title")), h("p", {}, t("empty_session.text")), buttons, box.element);
  return () => {};
}
