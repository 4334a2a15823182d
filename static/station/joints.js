/** How good the calibration is for each joint: a word and a colour by joint, and why where it is not good. */
import { h, whenChanged } from "../dom.js";
import { segmentWords, wholeJoint } from "../words/clinical.js";
import { labelled } from "../words/joined.js";
import { t } from "../words/words.js";
import { HAND_ROWS } from "./joint_rows.js";

const COLOUR = { good: "good", fair: "", poor: "warn", none: "" };
const OPEN = ["pose_review"];

export function mount(root, api, { station }) {
  const body = h("tbody", {});
  const why = h("ul", { class: "small" });
  const columns = ["angles.finger", "angles.base", "angles.middle", "angles.end"].map((word) => h("th", { scope: "col" }, t(word)));
  const worst = h("span", { class: "badge" });
  const box = h(
    "details",
    {},
    h("summary", {}, t("joints.title"), worst),
    h("table", { class: "compact" }, h("thead", {}, h("tr", {}, columns)), body),
    why,
  );
  root.append(box);
  const draw = whenChanged(
    ({ calibration }) => calibration?.joints ?? [],
    (joints) => {
      root.hidden = !joints.length;
      const byJoint = Object.fromEntries(joints.map((joint) => [joint.joint, joint]));
      const least = ["poor", "fair", "good"].find((grade) => joints.some((joint) => joint.grade === grade)) ?? "none";
      mark(worst, least);
      body.replaceChildren(...(joints.length ? HAND_ROWS.map(([finger, names]) => row(finger, names.map((name) => byJoint[name]))) : []));
      why.replaceChildren(...reasons(joints).map((words) => h("li", {}, words)));
    },
  );
  const open = whenChanged(
    ({ wizard }) => OPEN.includes(wizard.state),
    (reviewing) => (box.open = reviewing),
  );
  const leave = [station.on("full", draw), station.on("full", open)];
  return () => leave.forEach((stop) => stop());
}

function row(finger, joints) {
  const cells = joints.map((joint) => {
    const badge = h("span", {});
    mark(badge, joint.grade);
    return h("td", { colspan: joints.length === 1 && 3 }, badge);
  });
  return h("tr", {}, h("th", { scope: "row" }, t(`finger.${finger}`)), cells);
}

function mark(badge, grade) {
  badge.className = `badge ${COLOUR[grade]}`;
  badge.textContent = t(`joints.${grade}`);
}

/** One sentence a cause; where it is the same for several joints, one for all of them. */
function reasons(joints) {
  const jointsByReason = new Map();
  for (const { joint, grade, reason, segment, deg } of joints) {
    if (!reason || grade === "good") continue;
    const words = t(`joints.why.${reason}`, { part: segmentWords(segment), deg });
    jointsByReason.set(words, [...(jointsByReason.get(words) ?? []), wholeJoint(joint)]);
  }
  return [...jointsByReason].map(([words, names]) => (names.length > 4 ? words : labelled(names.join(", "), words)));
}
