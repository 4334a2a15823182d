/** A figure's course in words: what it is, its value, how it changed. */
import { angleWords, directionWords, jointWords, unitWords } from "../words/clinical.js";
import { directionsOf } from "../words/directions.js";
import { decimal, t } from "../words/words.js";

export const PARTS = ["thumb", "index", "middle", "ring", "little", "wrist", "forearm", "all"];

/** The finger or the wrist that a figure is of; "all" where it is of none. */
export const partOf = (series) => series.finger || series.joint.split("_")[0] || "all";

/** "Index PIP, flexion", "Rate". */
export function labelWords(series) {
  if (!series.joint) return series.label;
  const turned = series.angle !== "flexion" || series.joint === "thumb_cmc";
  const way = turned ? directionWords(series.joint, series.angle, series.end === "largest") : t(`course.way.${series.end}`);
  return t("course.figure", { ...jointWords(series.joint), way }).replace(/ +(?=[ ,])/g, "");
}

/** Of an angle with its direction where the figure's name does not say it; beyond straight is more than "extension". */
export function valueWords(series, value) {
  if (series.joint) {
    const straightens = series.angle === "flexion" && !/^(wrist|thumb_cmc)$/.test(series.joint);
    const isNamed = value > 0 === (series.end === "largest") && !(straightens && value < 0);
    return isNamed ? `${Math.abs(Math.round(value))}°` : angleWords(series.joint, series.angle, value);
  }
  const size = withUnit(series, Math.abs(value));
  const direction = directionsOf(series.name)[Number(value > 0)];
  return direction && size !== withUnit(series, 0) ? t(`direction.${direction}`, { size }) : size;
}

/** The newest value against the first or the one before: { value, then, beyond }; beyond is null where it is not judged. */
export function judged(series, { hand, against }) {
  const { points } = series.hands[hand];
  const [now, then] = [points.at(-1), against === "first" ? points[0] : points.at(-2)];
  return { value: now[1], then: then[1], beyond: now[against === "first" ? 2 : 3] };
}

/** "15° more", "0.40 per s lower"; more of an angle is further in the figure's own direction. */
export function changeWords(series, chosen) {
  const { value, then } = judged(series, chosen);
  const size = withUnit(series, Math.abs(value - then));
  if (size === withUnit(series, 0)) return t("course.same");
  const up = value > then !== (series.end === "smallest");
  return t(`course.${series.joint ? "angle" : "level"}.${up ? "up" : "down"}`, { size });
}

/** Steps between an axis' ticks, so coarse that no two ticks read the same. */
export function stepsOf(series) {
  const least = -decimalsOf(series, 0);
  return Array.from({ length: 9 }, (_, k) => [1, 2, 5].map((n) => n * 10 ** (least + k))).flat();
}

/** Whole numbers without decimals, and no unit but degrees: the figure's name stands beside them. */
export function tickWords(series, tick) {
  const plain = decimal(tick, decimalsOf(series, tick)).replace(/[.,]0+$/, "").replace("-", "−"); // prettier-ignore
  if (!series.joint) return series.unit === "deg" ? `${plain}°` : plain;
  return valueWords(series, tick);
}

/** Of a count none; the mean of several may be broken. */
const decimalsOf = ({ unit, decimals }, value) => (unit === "" && Number.isInteger(value) ? 0 : decimals);

function withUnit(series, value) {
  if (series.joint) return `${Math.round(value)}°`;
  const [size, unit] = [decimal(value, decimalsOf(series, value)), unitWords(series.unit.replace("deg", "°"))];
  return unit.startsWith("°") ? `${size}${unit}` : `${size} ${unit}`.trim();
}
