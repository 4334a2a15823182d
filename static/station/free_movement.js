/** Free movement: what is observable already, joint by joint; how far the computation is; what was found. */
import { h, hide, whenChanged } from "../dom.js";
import { progressBar } from "../progress_bar.js";
import { foundTables } from "../self_calibration_tables.js";
import { wholeJoint } from "../words/clinical.js";
import { t } from "../words/words.js";
import { FINGER_ROWS } from "./joint_rows.js";

const MOVING = ["free_countdown", "free_run", "free_work"];
const NAMED = 3; // joints that are named at a time
const ENOUGH = 1; // share of what is enough below which a joint is named
const LITTLE = 0.6; // below it a bar is not green

export function mount(root, api, { station }) {
  const body = h("tbody", {});
  const columns = ["angles.finger", "angles.base", "angles.middle", "angles.end"].map((word) => h("th", { scope: "col" }, t(word)));
  const head = h("thead", {}, h("tr", {}, columns));
  const lacking = h("p", { "aria-live": "polite" });
  const meter = h("div", {}, h("h3", {}, t("free.meter")), h("table", { class: "compact" }, head, body), lacking);
  const bar = progressBar(t("free.computing"));
  const tables = h("div", {});
  root.append(bar.element, meter, tables);

  const draw = ({ wizard, self_calibration }) => {
    hide(root, !self_calibration);
    hide(meter, !MOVING.includes(wizard.state));
    hide(bar.element, wizard.state !== "free_work");
    if (wizard.state === "free_work" && self_calibration) bar.set(self_calibration.share ?? 0, t("free.computing"));
  };
  const drawMeter = whenChanged(
    ({ wizard, self_calibration }) => [wizard.state, self_calibration?.meter ?? []],
    ([state, joints]) => {
      const seen = Object.fromEntries(joints.map((joint) => [joint.joint, joint]));
      const rows = FINGER_ROWS.filter(([, names]) => names.some((name) => seen[name]));
      body.replaceChildren(...rows.map(([finger, names]) => row(finger, names, seen)));
      const few = notEnough(joints);
      const named = few.slice(0, NAMED).join(", ");
      const lack = few.length ? t(few.length > NAMED ? "free.more.all" : "free.more", { joints: named }) : t("free.enough");
      if (state !== "free_work") lacking.textContent = joints.length ? lack : t("free.begins");
    },
  );
  const drawFound = whenChanged(
    ({ self_calibration }) => self_calibration?.found ?? null,
    (solution) => tables.replaceChildren(...(solution ? foundTables(solution).filter(Boolean) : [])),
  );
  const leave = [draw, drawMeter, drawFound].map((each) => station.on("full", each));
  return () => leave.forEach((stop) => stop());
}

/** Joints that were not moved enough, the one that lacks most first, in clinical words. */
export function notEnough(joints) {
  const few = joints.filter((joint) => joint.share < ENOUGH).sort((a, b) => a.share - b.share);
  return few.map((joint) => wholeJoint(joint.joint));
}

function row(finger, names, seen) {
  const cells = names.map((name) => h("td", {}, seen[name] ? gauge(seen[name]) : "–"));
  return h("tr", {}, h("th", { scope: "row" }, t(`finger.${finger}`)), cells);
}

function gauge({ joint, share, excursion_deg, length_mm }) {
  const words = t("free.joint", { joint: wholeJoint(joint), share: Math.round(100 * share), bent: excursion_deg, length: length_mm });
  const bar = h("meter", { min: 0, max: 1, low: LITTLE / 2, high: LITTLE, optimum: 1, "aria-label": words, title: words });
  bar.value = share;
  return bar;
}

