/** A table of another logger: what its columns are, what its numbers say of that, and then into the patient's sessions. */
import { h, icon, whenChanged } from "../dom.js";
import { choices, errorBox, onSubmit } from "../forms.js";
import * as columns from "../table/columns.js";
import * as events from "../table/events.js";
import * as findings from "../table/findings.js";
import * as layout from "../table/layout.js";
import { mapOf, startingMap } from "../table/map.js";
import * as rows from "../table/rows.js";
import * as timing from "../table/timing.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api, { id, go, title }) {
  const [patient, table] = id.split("/tables/");
  const at = `/api/patients/${patient}/tables/${table}`;
  const box = errorBox();
  const place = h("div", { class: "stack" }, h("p", { class: "soft" }, t("loading")));
  let leave = () => {};
  let gone = false;
  title(t("table.title"));
  root.append(
    h("div", { class: "head" }, h("div", {}, trail(patient), h("h1", {}, t("table.title")), lead())),
    box.element,
    place,
  );

  /** Read the table, laid out as asked or as it probably is. */
  async function read(asked) {
    try {
      const seen = await api.get(asked ? `${at}?${new URLSearchParams(asked)}` : at);
      if (gone) return;
      box.clear();
      draw(seen, !asked);
    } catch (error) {
      if (!gone) box.show(error, h("p", {}, h("a", { href: `/patients/${patient}` }, t("table.back"))));
    }
  }

  /** @param {import("../types/api.d.ts").TableAnswer} seen */
  function draw(seen, first) {
    leave();
    const state = startingMap(seen, first && seen.stored?.map);
    const form = h("form", { novalidate: true, class: "stack" });
    const seenBox = findings.make(api, at);
    const check = whenChanged(
      () => mapOf(state, seen),
      (map) => seen.map && seenBox.check(map),
    );
    const changed = () => check();
    const hands = choices(
      t("table.hand"),
      "table_hand",
      ["left", "right"].map((side) => ({ value: side, label: t(`hand.${side}.title`), checked: side === state.hand })),
      "two",
    );
    hands.addEventListener("change", (event) => {
      state.hand = event.target.value;
      changed();
    });
    const did = events.make(api, seenBox);
    const parts = [
      [t("table.file", { name: seen.name }), rows.make(seen), seen.is_text && layout.make(seen, read)],
      seen.map && [t("table.time"), timing.make(seen, state, changed), hands],
      seen.map && [t("table.columns"), offered(seen, state), columns.make(seen, state, changed)],
      seen.map && [t("table.seen"), seenBox.element],
      seen.map && [t("table.events"), did.element],
    ];
    form.append(
      ...parts.filter(Boolean).map(([heading, ...content]) => h("section", { class: "card" }, h("h2", {}, heading), content)),
      h("div", { class: "buttons" }, store(seen), h("button", { type: "button", class: "plain", onclick: giveUp }, t("table.give_up"))),
    );
    onSubmit(form, box, async () => {
      const sent = await api.post(`${at}/recording`, { map: mapOf(state, seen), ...did.value() });
      go(`/sessions/${sent.session}`);
    });
    place.replaceChildren(form);
    leave = seenBox.stop;
    changed();
  }

  async function giveUp() {
    await api.remove(at).catch(() => null);
    go(`/patients/${patient}`);
  }

  read(null);
  return () => {
    gone = true;
    leave();
  };
}

const lead = () => h("p", { class: "soft" }, t("table.lead"));

function trail(patient) {
  const link = (href, words) => h("a", { href }, t(words));
  return h("p", { class: "trail" }, link("/", "patients.title"), icon("chevron-right"), link(`/patients/${patient}`, "table.patient"));
}

const store = (seen) => h("button", { class: "primary large", type: "submit", disabled: !seen.map }, t("table.store"));

/** That the map of the last table with this header is taken; else what the guess leaves open. */
function offered(seen, state) {
  if (state.stored) return h("p", { class: "note" }, t("table.stored", { when: dayAndTime(seen.stored.changed) }));
  return seen.questions.map((question) => h("p", { class: "warning" }, question));
}
