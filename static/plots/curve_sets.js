/** Curves that are looked at together, by the name of the choice; and the line styles of a set. */
import { select } from "../forms.js";
import { curveWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const FINGERS = ["index", "middle", "ring", "little"];

export const SETS = {
  aperture: ["aperture"],
  thumb: ["thumb_cmc_flexion", "thumb_mcp_flexion", "thumb_ip_flexion"],
  ...Object.fromEntries(FINGERS.map((finger) => [finger, ["mcp", "pip", "dip"].map((joint) => `${finger}_${joint}_flexion`)])),
  spread: FINGERS.map((finger) => `${finger}_mcp_deviation`),
  thumb_base: ["thumb_cmc_flexion", "thumb_cmc_deviation", "thumb_cmc_pronation"],
  wrist: ["wrist_flexion", "wrist_deviation"],
};

export const LINES = [
  { colour: "--curve-1" },
  { colour: "--curve-2", dash: [8, 4] },
  { colour: "--curve-3", dash: [2, 3] },
  { colour: "--curve-4", dash: [12, 3, 2, 3] },
];

/** A choice of a set; tapping begins with the distance of thumb and index finger. */
export function chooseSet(tapping, onchange) {
  const rows = Object.keys(SETS).map((name) => [name, t(`set.${name}`)]);
  return select(rows, tapping ? "aperture" : "index", { "aria-label": t("curves.choose"), onchange });
}

/** A choice of one curve alone. */
export function chooseCurve(tapping, onchange) {
  const all = [...new Set(Object.values(SETS).flat())];
  const rows = all.map((what) => [what, curveWords(what)]);
  return select(rows, tapping ? "aperture" : "index_pip_flexion", { "aria-label": t("curves.choose"), onchange });
}

/** Where the curves of a result are asked for, between two moments in s where given. */
export function curvesAddress(result, shown, more = {}) {
  const query = new URLSearchParams([...shown.map((what) => ["what", what]), ...Object.entries(more)]);
  return `/api/results/${result}/curves?${query}`;
}
