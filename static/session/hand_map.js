/** A drawing of the hand with a dot at every joint, filled by how far it stays behind; each dot's title says it in words. */
import { s } from "../dom.js";
import { several } from "../words/joined.js";

const BOX = "0 0 240 280";
const JOINTS = {
  thumb: { cmc: [70, 214], mcp: [44, 178], ip: [24, 148] },
  index: { mcp: [84, 142], pip: [76, 92], dip: [72, 62] },
  middle: { mcp: [116, 134], pip: [115, 78], dip: [114, 44] },
  ring: { mcp: [146, 140], pip: [152, 88], dip: [156, 56] },
  little: { mcp: [172, 154], pip: [184, 114], dip: [191, 90] },
};
const TIPS = { thumb: [10, 124], index: [69, 36], middle: [114, 16], ring: [159, 30], little: [197, 68] };
const PALM = "M84 142 L116 134 L146 140 L172 154 L164 214 L146 250 L96 250 L70 214 Z";
const MIRRORED = "translate(240 0) scale(-1 1)"; // the drawing is of a right hand
const WRIST = [120, 246];

/** The back of a left or right hand. */
export function handMap(joints, hand, choose) {
  const fingers = Object.entries(JOINTS).map(([finger, at]) => {
    const points = [...Object.values(at), TIPS[finger]].map((point) => point.join(" "));
    return s("polyline", { points: points.join(" "), class: "bone" });
  });
  const dots = joints.filter(({ joint }) => placeOf(joint)).map((joint) => dot(placeOf(joint.joint), joint, choose));
  const transform = hand === "left" ? MIRRORED : "";
  const parts = s("g", { transform }, s("path", { d: PALM, class: "palm" }), fingers, dots);
  const drawing = s("svg", { viewBox: BOX, role: "img" }, parts);
  drawing.setAttribute("aria-label", several(joints.map(({ words }) => words)));
  return drawing;
}

function placeOf(joint) {
  const [finger, name] = joint.split("_");
  return finger === "wrist" ? WRIST : JOINTS[finger]?.[name];
}

/** Large is a square and small a diamond: the colour is not all that tells them apart. */
function dot([x, y], { joint, words, level }, choose) {
  const shape = shapeOf(x, y, level, s("title", {}, words));
  shape.addEventListener("click", () => choose(joint));
  return shape;
}

function shapeOf(x, y, level, title) {
  if (level === "none") return s("circle", { cx: x, cy: y, r: 7, class: `level-${level}` }, title);
  const turn = level === "small" ? ` rotate(45 ${x} ${y})` : "";
  return s("rect", { x: x - 7, y: y - 7, width: 14, height: 14, transform: turn.trim(), class: `level-${level}` }, title);
}
