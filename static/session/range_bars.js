/** Every joint's range as a bar, the other hand's below it, the reference as a tick; a press shows the joint's curve. */
import { h, s } from "../dom.js";
import { t } from "../words/words.js";

const AIR = 5; // degrees beyond the longest bar
const LEAST = [-20, 110]; // degrees that every bar's scale spans
const HEIGHT = 28;
const OWN = { y: 3, height: 11 };
const OTHER = { y: 17, height: 6 };

export function mount(root, { joints, hand, choose }) {
  const ends = joints.flatMap(({ range, other, reference }) => [...range, ...(other ?? []), reference ?? 0]);
  const [low, high] = [Math.min(LEAST[0], ...ends) - AIR, Math.max(LEAST[1], ...ends) + AIR];
  const row = (joint) =>
    h(
      "li",
      {},
      h(
        "button",
        { type: "button", class: "plain", title: joint.words, onclick: () => choose(joint.joint) },
        h("span", {}, joint.name),
        bar(joint, low, high),
        h("span", { class: "value" }, `${joint.range[1]}°`),
      ),
    );
  const other = hand === "left" ? "right" : "left";
  const caption = joints.some((joint) => joint.other) ? "bars.caption.both" : "bars.caption";
  root.append(
    h("h3", {}, t("bars.title")),
    h("ul", { class: "bars" }, joints.map(row)),
    h("p", { class: "hint" }, t(caption, { other: t(`hand.${other}.title`) })),
  );
}

function bar({ range, other, reference, level, words }, low, high) {
  const at = (value) => value - low;
  const rect = ([from, to], kind, place) => s("rect", { x: at(from), width: Math.max(to - from, 1), class: kind, ...place });
  const line = (value, kind) =>
    s("line", { x1: at(value), x2: at(value), y1: 0, y2: HEIGHT, class: kind, "vector-effect": "non-scaling-stroke" });
  const parts = [line(0, "zero"), rect(range, `level-${level}`, OWN)];
  if (other) parts.push(rect(other, "other", OTHER));
  if (reference !== null) parts.push(line(reference, "tick"));
  const drawing = s("svg", { viewBox: `0 0 ${high - low} ${HEIGHT}`, preserveAspectRatio: "none", role: "img" }, parts);
  drawing.setAttribute("aria-label", words);
  return drawing;
}
