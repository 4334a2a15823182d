/** The result at one glance: two to four figures a task with what they are compared with, and the joints that stay behind. */
import { h } from "../dom.js";
import { together } from "../words/joined.js";
import { day, t } from "../words/words.js";
import { handMap } from "./hand_map.js";
import * as jointCurve from "./joint_curve.js";
import * as rangeBars from "./range_bars.js";

const BEHIND = ["small", "large"];
const MDC = 12; // degrees, as the server judges (app/results/headlines.py)

export function mount(root, api, { session, result }) {
  const { headlines, joints, changes } = result.readings;
  if (!headlines.length && !joints.length) return () => {};
  const tiles = (task) => h("div", { class: "tiles" }, task.tiles.map((one) => tile(one, changes?.since)));
  const tasks = headlines.map((task) => h("div", {}, h("h3", {}, task.title), tiles(task)));
  const bars = h("div", {});
  const below = h("div", {});
  const curve = jointCurve.mount(below, api, { result });
  const drawn = joints.length > 0 && drawing(joints, session.hand, curve.show);
  if (joints.length) rangeBars.mount(bars, { joints, hand: session.hand, choose: curve.show });
  root.append(
    h(
      "div",
      { class: "card" },
      h("h2", {}, t("headlines.title")),
      h("div", { class: joints.length ? "glance" : "" }, drawn, h("div", { class: "stack" }, tasks, joints.length ? [bars, below] : [])),
    ),
  );
  return curve.unmount;
}

function tile({ label, value, sd, grade, against, change, beyond, wanted, verdict }, since) {
  const sense = wanted && h("span", { class: "sense" }, t(`headlines.wanted.${wanted}`));
  const judged = verdict && h("span", { class: `badge ${verdict === "better" ? "good" : "bad"}` }, t(`headlines.${verdict}`));
  return h(
    "div",
    { class: `tile ${beyond ? "beyond" : ""}` },
    h("p", { class: "soft small" }, label, sense),
    h("p", { class: "value" }, together(value), sd && h("small", { class: "soft" }, " ", together(sd))),
    grade !== "good" && h("p", {}, h("span", { class: "badge warn" }, t("headlines.signal", { grade: t(`grade.${grade}`) }))),
    against.map((words) => h("p", { class: "small" }, together(words))),
    change && h("p", { class: "small judgement" }, together(t("headlines.since", { day: day(since), change })), " ", judged),
  );
}

function drawing(joints, hand, choose) {
  const behind = joints.filter((joint) => BEHIND.includes(joint.level)).map((joint) => joint.words);
  const key = ["none", "small", "large"].map((level) =>
    h("li", {}, h("span", { class: `key-dot level-${level}` }), t(`headlines.level.${level}`, { size: MDC })),
  );
  return h(
    "figure",
    { class: "hand-map" },
    handMap(joints, hand, choose),
    h("figcaption", { class: "small" }, h("p", {}, t("headlines.joints")), h("ul", { class: "legend" }, key)),
    behind.length
      ? [h("p", { class: "small" }, t("headlines.behind")), h("ul", { class: "small" }, behind.map((words) => h("li", {}, words)))]
      : h("p", { class: "small" }, t("headlines.nothing_behind")),
  );
}
