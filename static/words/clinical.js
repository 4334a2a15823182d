/** Clinical words for what is measured: a direction in words, never a bare plus or minus. Degrees come in, text goes out. */
import { known, t } from "./words.js";

const SEGMENT = /\b(thumb|index|middle|ring|little)_(metacarpal|proximal|middle|distal)\b/g;
const JOINT = /\b(thumb|index|middle|ring|little)_(cmc|mcp|pip|dip|ip)\b/g;
const PLAIN = { aperture: (value) => `${value} mm`, palm_turn: (value) => `${value}°` }; // curves that are no joint's angle
const ALIASES = { fingertips_force: "force" }; // of a strip; simulated recordings have the short name

/** A unit as people read it. */
export function unitWords(unit) {
  return known(`unit.${unit.replaceAll(" ", "_")}`, unit);
}

/** "index_pip" as { finger: "Index finger", joint: "PIP" }. */
export function jointWords(joint) {
  const [finger, name = ""] = joint.split("_");
  return { finger: t(`finger.${finger}`), joint: known(`joint.${name}`, name.toUpperCase()) };
}

/** "index_pip" as "Index finger PIP". */
export function wholeJoint(name) {
  return Object.values(jointWords(name)).join(" ").trim();
}

/** A strip, or the stream of its samples, by its name in recordings. */
export function stripWords(name) {
  return known(`strip.${ALIASES[name] ?? name}`, name);
}

/** What recorded: a product's name as it is, what only plays a glove in words. */
export function deviceWords(name) {
  return known(`device.${name.replaceAll(" ", "_")}`, name);
}

/** A segment with a sensor: "index_distal" is "index finger". */
export function partWords(segment) {
  return t(`part.${segment.split("_")[0]}`);
}

/** A segment exactly: "index finger, end". */
export function segmentWords(segment) {
  const [part, piece] = segment.split("_");
  return piece ? t("segment", { part: t(`part.${part}`), piece: t(`piece.${piece}`) }) : t(`part.${part}`);
}

/** A sentence that names sensors and joints as files do, in the words that people use: "index_distal" is "Index finger, end segment". */
export function inWords(sentence) {
  const named = sentence.replace(SEGMENT, segmentWords).replace(JOINT, (joint) => wholeJoint(joint));
  const words = unitSigns(named);
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** A text with "°" where the program's words have "deg". */
export function unitSigns(text) {
  const degrees = text.replace(/(\d) deg\b/g, "$1°").replace(/\bdeg\b/g, "°");
  return degrees.replace(/\bs\^2/g, "s²").replace(/\buT\b/g, "µT").replace(/\bsqrt\((\w+)\)/g, "√$1");
}

/** "34° flexed", "4° extended", "0°". */
export function angleWords(joint, angle, degrees) {
  const size = Math.abs(Math.round(degrees));
  return size ? `${size}° ${directionWords(joint, angle, degrees > 0)}` : "0°";
}

/** Which way a positive or negative angle of a joint goes. */
export function directionWords(joint, angle, positive) {
  const side = positive ? "pos" : "neg";
  return known(`way.${joint}.${angle}.${side}`, null) ?? t(`way.${angle}.${side}`);
}

/** The name of a curve: "aperture" or an angle such as index_pip_flexion. */
export function curveWords(what) {
  if (PLAIN[what]) return t(`curve.${what}`);
  const { joint, angle } = partsOf(what);
  const words = jointWords(joint);
  return t("curve.angle", { joint: `${words.finger} ${words.joint}`.trim(), motion: motionWords(joint, angle) });
}

/** The joint alone of an angle such as index_pip_flexion: "PIP". */
export function jointName(what) {
  return jointWords(partsOf(what).joint).joint;
}

/** The name of a curve that stands for the same joint of several fingers. */
export function sameJointWords(what) {
  const { joint, angle } = partsOf(what);
  return t("curve.angle", { joint: jointName(what), motion: motionWords(joint, angle) });
}

/** What tells a curve from the others beside it: the finger, the joint, or the motion. */
export function distinctWords(what, all) {
  const parts = all.map(partsOf);
  const { joint, angle } = partsOf(what);
  const fingers = new Set(parts.map((part) => part.joint.split("_")[0]));
  const joints = new Set(parts.map((part) => part.joint));
  return fingers.size > 1 ? jointWords(joint).finger : joints.size > 1 ? jointWords(joint).joint : motionWords(joint, angle);
}

/** What an angle of a joint measures: "flexion", "sideways", "palmar abduction", "turn". */
export function motionWords(joint, angle) {
  return known(`motion.${joint}.${angle}`, null) ?? t(`motion.${angle}`);
}

/** A value on a curve's axis: "40 mm", "90°", "10° ext.". */
export function valueWords(what, value) {
  if (PLAIN[what]) return PLAIN[what](Math.round(value));
  const { joint, angle } = partsOf(what);
  return angleWords(joint, angle, value);
}

function partsOf(what) {
  const cut = what.lastIndexOf("_");
  return { joint: what.slice(0, cut), angle: what.slice(cut + 1) };
}
