/** Which protocol a session follows: that of the patient's last session, else the usual assessment; what it says to mind stands below. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";

export function mount(root, api, { patient }) {
  let gone = false;
  let choice = null;

  async function load() {
    const plans = await api.get("/api/assessment-plans");
    if (gone) return;
    const last = patient.sessions.find((session) => session.plan.name)?.plan.name;
    const rows = [["", t("new_session.plan.none")], ...plans.map((plan) => [plan.name, plan.title])];
    const now = plans.some((plan) => plan.name === last) ? last : "";
    const note = h("p", { class: "hint" });
    const say = () => (note.textContent = plans.find((plan) => plan.name === choice.value)?.content.note ?? "");
    choice = select(rows, now, { name: "plan", onchange: say });
    const edit = h("p", { class: "hint" }, h("a", { href: "/protocols" }, t("new_session.plan.edit")));
    root.replaceChildren(h("div", { class: "field" }, field(t("new_session.plan"), choice), note, edit));
    say();
  }

  return {
    load,
    chosen: () => choice?.value ?? "",
    unmount: () => {
      gone = true;
    },
  };
}
