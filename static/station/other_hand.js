/** Go on with the other hand in the same visit, where this hand's tasks could be finished; at the second hand what was first. */
import { h, whenChanged } from "../dom.js";
import { errorBox, field, onSubmit, once, select } from "../forms.js";
import { open } from "./actions.js";
import { named } from "./confirming.js";
import { makeKept } from "../patient/stored_calibrations.js";
import * as reuse from "../patient/reuse.js";
import { t } from "../words/words.js";

const SAME = ""; // the port of this session's glove

export function mount(root, api, { station, session, go }) {
  const other = session.hand === "left" ? "right" : "left";
  const place = h("div", {});
  const box = errorBox();
  const press = () => once(opener, box, ask);
  const opener = h("button", { class: "large", "data-other-hand": true, onclick: press }, t(`other_hand.open.${other}`));
  let close = () => {};

  async function ask() {
    const gloves = await api.get("/api/gloves");
    const earlier = h("div", {});
    const taken = reuse.mount(earlier, api, { kept: makeKept(api, session.patient.id) });
    await taken.ask(other);
    const free = gloves.filter((glove) => !glove.in_use && glove.hand !== session.hand);
    const fitting = free.find((glove) => glove.hand === other);
    const options = [...free.map((glove) => [glove.path, glove.description]), [SAME, t("other_hand.glove.same")]];
    const glove = select(fitting ? options.slice(0, -1) : options, fitting?.path ?? SAME, { name: "other-glove" });
    const left = open(station.latest.wizard).map((task) => task.title);
    const back = h("button", { class: "large", type: "button", "data-back": true, onclick: () => close() }, t("go_back"));
    const send = h("button", { class: "primary large", type: "submit" }, t(`other_hand.send.${other}`));
    const form = h(
      "form",
      { class: "question", novalidate: true },
      h("p", {}, t("other_hand.sure")),
      left.length > 0 && h("p", {}, t("other_hand.left_tasks", { tasks: named(left) })),
      field(t("other_hand.glove"), glove),
      earlier,
      box.element,
      h("div", { class: "buttons-tall" }, send, back),
    );
    onSubmit(form, box, () => goOn({ port: glove.value, reuse: taken.decision }));
    close = () => {
      box.clear();
      place.replaceChildren(opener, box.element);
      opener.focus();
    };
    place.replaceChildren(form);
    back.focus(); // Enter, pressed once too often, ends nothing
    form.scrollIntoView({ block: "nearest" });
  }

  /** This station ends before the answer comes: its end must not lead to the session's page. */
  async function goOn({ port, reuse: decide }) {
    const decision = await decide();
    const following = await station.endFor(() => api.post(`/api/stations/${station.name}/other-hand`, { port, reuse: decision }));
    go(`/stations/${following.station}`, true);
  }

  const draw = whenChanged(
    ({ wizard, relayed, continues }) => wizard.actions.includes("finish") && !relayed && !continues,
    (offered) => (place.hidden = !offered),
  );
  const first = session.other_hand && station.latest.continues;
  const href = `/sessions/${session.other_hand?.session}`;
  const link = h("a", { href, target: "_blank", rel: "noopener" }, t("other_hand.first"));
  const note = first && h("p", { class: "soft" }, t("other_hand.second"), " ", link);
  place.append(opener, box.element);
  root.append(...[note, place].filter(Boolean));
  return station.on("full", draw);
}
