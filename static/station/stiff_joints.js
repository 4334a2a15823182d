/** Joints that cannot be straightened: their flexion as measured counts in every pose after it was entered. */
import { h, whenChanged } from "../dom.js";
import { errorBox, field, once, onSubmit, select } from "../forms.js";
import { FINGER_ROWS } from "./joint_rows.js";
import { angleWords, wholeJoint } from "../words/clinical.js";
import { labelled } from "../words/joined.js";
import { t } from "../words/words.js";

const SHOWN = ["pose_ready", "pose_review"];
const HINGED = FINGER_ROWS.flatMap(([, joints]) => joints).filter((joint) => joint !== "thumb_cmc");

export function mount(root, api, { station }) {
  const box = errorBox();
  const joint = select([["", t("stiff.choose")], ...HINGED.map((name) => [name, wholeJoint(name)])], "", { name: "stiff-joint" });
  const flexion = h("input", { type: "number", step: 1, name: "stiff-flexion" });
  const add = h("button", { type: "submit" }, t("stiff.add"));
  const form = h("form", { class: "buttons", novalidate: true }, field(t("stiff.joint"), joint), field(t("stiff.flexion"), flexion), add);
  const rows = h("ul", {});
  const again = h("div", { role: "status" });
  const lead = h("p", { class: "soft" }, t("stiff.lead"));
  const folded = h("details", {}, h("summary", {}, t("stiff.title")), lead, rows, again, form, box.element);
  root.append(folded);

  /** @param {Record<string, number>} angles by joint, all of them, deg */
  const send = (angles) => api.put(`/api/stations/${station.name}/stiff-joints`, { angles });

  onSubmit(form, box, async () => {
    if (!joint.value || Number.isNaN(flexion.valueAsNumber)) throw new Error(t("stiff.missing"));
    await send({ ...station.latest.stiff_joints.angles, [joint.value]: flexion.valueAsNumber });
    joint.value = flexion.value = "";
    joint.focus();
  });

  function row([name, degrees]) {
    const remove = async () => {
      const { [name]: _, ...rest } = station.latest.stiff_joints.angles;
      await send(rest);
      joint.focus();
    };
    const press = () => once(button, box, remove);
    const label = t("stiff.remove.joint", { joint: wholeJoint(name) });
    const button = h("button", { type: "button", class: "plain", "aria-label": label, onclick: press }, t("stiff.remove"));
    return h("li", {}, labelled(wholeJoint(name), angleWords(name, "flexion", degrees)), " ", button);
  }

  /** What comes above a field that has the focus does not push it out of sight. */
  const keepSeen = () => form.contains(document.activeElement) && document.activeElement.scrollIntoView({ block: "nearest" });
  const drawRows = whenChanged(
    ({ stiff_joints }) => stiff_joints.angles,
    (angles) => (rows.replaceChildren(...Object.entries(angles).map(row)), keepSeen()),
  );
  const drawState = whenChanged(
    ({ wizard, stiff_joints }) => [wizard.state, wizard.state === "pose_review" ? stiff_joints.asked : []],
    ([state, asked]) => {
      box.clear();
      root.hidden = !SHOWN.includes(state);
      const entered = Object.keys(station.latest.stiff_joints.angles);
      folded.open = asked.length + entered.length > 0;
      joint.value ||= asked.find((name) => !entered.includes(name)) ?? "";
    },
  );
  const drawAgain = whenChanged(
    ({ wizard, stiff_joints }) => wizard.state === "pose_review" && stiff_joints.pending,
    (due) => {
      again.replaceChildren(...(due ? [h("p", { class: "warning" }, t("stiff.again", { button: t("act.redo") }))] : []));
      keepSeen();
    },
  );
  const leave = [drawRows, drawState, drawAgain].map((draw) => station.on("full", draw));
  return () => leave.forEach((stop) => stop());
}
