/** A small drawing of a hand, palm towards the viewer, with the length that is to be taken marked on it. */
import { s } from "../dom.js";

const BOX = "0 0 120 152";
const SKIN = 12; // width of a finger
const EDGE = 3; // of the outline
/** Where each finger leaves the palm, and the middle of its end. */
const FINGERS = {
  thumb: [34, 98, 13, 68],
  index: [43, 72, 37, 26],
  middle: [57, 69, 56, 16],
  ring: [71, 71, 75, 24],
  little: [84, 78, 93, 43],
};
const PALM = "M37 74 L90 76 L86 106 L78 126 L46 126 L38 108 Z";
const WEB = "M36 82 L34 98 L46 118 Z"; // between thumb and palm
const FOREARM = "M48 122 L76 122 L75 152 L49 152 Z";
const WRIST = [62, 126];
const KNUCKLES = { thumb: [29, 90], index: [43, 78], middle: [57, 75], ring: [71, 77], little: [84, 83] };

const TAKEN = {
  hand_length: [[WRIST, end("middle")]],
  hand_breadth: [[[31, 79], [96, 81]]],
  palm_length: [[WRIST, KNUCKLES.middle]],
  finger_length: Object.keys(FINGERS).map((finger) => [KNUCKLES[finger], end(finger)]),
};

/** The drawing for a measure; `finger` marks that one alone. It says nothing that the words beside it do not. */
export function handDrawing(measure, finger = "") {
  const names = Object.keys(FINGERS);
  const lines = TAKEN[measure].filter((_, k) => !finger || names[k] === finger);
  return s(
    "svg",
    { viewBox: BOX, class: "hand", "aria-hidden": "true", focusable: "false" },
    hand("edge", EDGE),
    hand("skin", 0),
    s("path", { class: "crease", d: "M47 126 Q62 130 77 126" }),
    lines.map(measured),
  );
}

function hand(kind, more) {
  const fingers = Object.values(FINGERS).map(([x1, y1, x2, y2]) => s("line", { x1, y1, x2, y2, "stroke-width": SKIN + 2 * more }));
  const flesh = [PALM, WEB, FOREARM].map((d) => s("path", { d, "stroke-width": 8 + 2 * more }));
  return s("g", { class: kind }, fingers, flesh);
}

/** A line with a bar across either end. */
function measured([from, to]) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const across = 5 / Math.hypot(dx, dy);
  const bars = [from, to].map(([x, y]) => `M${x - dy * across} ${y + dx * across} L${x + dy * across} ${y - dx * across}`);
  return s("path", { class: "taken", d: `M${from} L${to} ${bars.join(" ")}` });
}

/** The outer end of a finger. */
function end(finger) {
  const [x1, y1, x2, y2] = FINGERS[finger];
  const beyond = SKIN / 2 / Math.hypot(x2 - x1, y2 - y1);
  return [x2 + (x2 - x1) * beyond, y2 + (y2 - y1) * beyond];
}
