/** Begin a live session: which hand, which glove; then to the station. */
import { h } from "../dom.js";
import { choices, errorBox, field, onSubmit } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";
import * as relay from "../relay/relay.js";
import * as planChoice from "./plan_choice.js";
import { prefetchStation } from "./prefetch.js";
import * as reuse from "./reuse.js";

const OTHER = "?";
const CLOCKS = 5 * 60_000; // ms that the clocks of browser and server may differ

export function mount(root, api, { record, kept, go }) {
  const box = errorBox();
  const patient = record.now;
  const hand = patient.affected_hand === "left" || patient.affected_hand === "right" ? patient.affected_hand : null;
  const hands = choices(
    t("new_session.hand"),
    "hand",
    ["left", "right"].map((side) => ({ value: side, label: t(`hand.${side}.title`), checked: side === hand })),
    "two",
  );
  const gloves = h("div", {}, h("p", { class: "soft" }, t("new_session.looking")));
  const port = h("input", { name: "port", autocomplete: "off", spellcheck: "false" });
  const other = h("div", { hidden: true }, field(t("new_session.port"), port, t("new_session.port.hint")));
  const earlier = h("div", {});
  const taken = reuse.mount(earlier, api, { kept });
  const examiner = h("input", { name: "examiner", maxlength: 200, autocomplete: "off" });
  const outlets = h("div", {});
  const planned = h("div", {});
  const plan = planChoice.mount(planned, api, { patient });
  const form = h(
    "form",
    { novalidate: true },
    hands,
    gloves,
    other,
    earlier,
    outlets,
    h("div", { class: "side-by-side" }, planned, field(t("new_session.examiner"), examiner, t("new_session.examiner.hint"))),
    box.element,
    h("button", { class: "primary large", type: "submit" }, t("new_session.start")),
  );
  let [gone, known] = [false, []]; // gloves that were found
  const chosen = (name) => form.querySelector(`input[name=${name}]:checked`)?.value;
  const toggle = () => (other.hidden = chosen("glove") !== OTHER);

  async function look() {
    const found = await api.get("/api/gloves");
    if (gone) return;
    known = found;
    const options = found.map((g) => ({
      value: g.path,
      label: capital(g.description),
      note: g.in_use ? t("new_session.in_use") : g.virtual ? t("new_session.virtual") : g.path,
      disabled: g.in_use,
    }));
    gloves.replaceChildren(
      choices(
        t("new_session.glove"),
        "glove",
        [...options, relay.option(), { value: OTHER, label: t("new_session.other"), note: t("new_session.other.note") }],
        "several",
      ),
    );
    suggest();
  }

  /** The free glove of the hand, else one that may be of either. */
  function suggest() {
    const free = [...gloves.querySelectorAll("input:not(:disabled)")].filter((input) => input.value !== OTHER);
    const of = (hand) => free.find((input) => (known.find((glove) => glove.path === input.value)?.hand ?? null) === hand);
    const pick = (chosen("hand") ? (of(chosen("hand")) ?? of(null)) : free[0]) ?? gloves.querySelector(`input[value="${OTHER}"]`);
    if (pick) pick.checked = true;
    toggle();
  }

  /** What the administrator allowed; nothing is ticked by itself. */
  async function offerOutlets() {
    const allowed = await api.get("/api/outlets");
    if (gone || !allowed.length) return;
    const rows = allowed.map(({ address }) =>
      h(
        "label",
        { class: "choice" },
        h("input", { type: "checkbox", value: address }),
        h("span", {}, address, h("small", {}, t(`new_session.outlets.${address.split(":")[0]}`))),
      ),
    );
    const legend = h("legend", {}, t("new_session.outlets"));
    outlets.replaceChildren(h("fieldset", { class: "field" }, legend, h("div", { class: "choices" }, rows)));
  }

  const askEarlier = () => taken.ask(chosen("hand")).catch((error) => gone || box.show(error));
  form.addEventListener("change", (event) => {
    if (event.target.name !== "hand") return toggle();
    suggest();
    return askEarlier();
  });
  onSubmit(form, box, async () => {
    if (!chosen("hand")) throw new Error(t("new_session.which_hand"));
    const path = chosen("glove") === OTHER ? port.value.trim() : chosen("glove");
    if (!path) throw new Error(t("new_session.which_glove"));
    const fits = known.find((glove) => glove.path === path)?.hand ?? chosen("hand");
    const other = { glove: t(`hand.${fits}`), hand: t(`hand.${chosen("hand")}`) };
    if (fits !== chosen("hand")) throw new Error(t("new_session.other_hand", other));
    const which = path === relay.PORT ? await relay.choose() : undefined;
    if (which === null) throw new Error(t("relay.none_chosen"));
    const begun = await api.post(`/api/patients/${record.now.id}/sessions`, {
      hand: chosen("hand"),
      port: path,
      examiner: examiner.value.trim(),
      plan: plan.chosen(),
      reuse: await taken.decision(),
      outlets: [...outlets.querySelectorAll("input:checked")].map((input) => input.value),
    });
    if (which) relay.begin(begun.session, which);
    go(`/stations/${begun.station}`);
  });
  root.append(h("h2", {}, t("new_session.title")), h("p", { class: "soft" }, t("new_session.lead")), ...clockWarnings(patient), form);
  askEarlier();
  const stop = kept.watch(askEarlier);
  const loaded = [look(), plan.load(), offerOutlets()].map((part) => part.catch((error) => gone || box.show(error)));
  Promise.all(loaded).then(() => (gone ? null : prefetchStation().catch(() => {}))); // what fails the station asks for itself
  return () => {
    gone = true;
    plan.unmount();
    stop();
  };
}

/** What speaks against the clock that dates the session. */
function clockWarnings({ clock, sessions }) {
  const browser = Math.abs(Date.now() - Date.parse(clock.now)) > CLOCKS ? ["browser"] : [];
  const last = sessions.length ? dayAndTime(sessions[0].started) : "";
  return [...clock.doubts, ...browser].map((doubt) =>
    h("p", { class: "warning" }, t(`clock.${doubt}`, { now: dayAndTime(clock.now), last }), " ", t("clock.next")),
  );
}

function capital(text) {
  return text[0].toUpperCase() + text.slice(1);
}
