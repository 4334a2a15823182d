/** The sensors finger by finger: what moves lights up, what was seen is ticked, and what is wrong is said with what to do. */
import { h, icon, whenChanged } from "../dom.js";
import { inWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const FINGERS = ["thumb", "index", "middle", "ring", "little"];
const SIGN = { seen: "check", wrong: "triangle-alert", dead: "x", asked: "arrow-right" };

export function mount(root, api, { station }) {
  const list = h("ul", { class: "fingers" });
  const verdict = h("div", { role: "status" });
  root.append(list, verdict);
  let lit = new Set(); // fingers that lit up since the page stands
  const draw = whenChanged(
    ({ wizard, glove, sensor_faults }) => [
      wizard.check,
      wizard.state,
      wizard.still ? "" : wizard.fastest_segment.split("_")[0],
      glove.flowing,
      sensor_faults,
    ],
    ([check, state, moving, flowing, faults]) => {
      root.hidden = !check || state === "pose_review" || !flowing;
      if (root.hidden) return;
      if (state === "connect" && FINGERS.includes(moving)) lit = lit.add(moving);
      list.replaceChildren(...FINGERS.map((finger) => chip(finger, standing(finger, check, state), finger === moving)));
      verdict.replaceChildren(...(state === "checked" ? verdicts(check, faults) : []));
    },
  );

  function standing(finger, { fingers, asked, moved }, state) {
    if (!fingers.includes(finger)) return "missing";
    if (finger === asked) return "asked";
    if (finger in moved) return moved[finger] === finger ? "seen" : moved[finger] ? "wrong" : "dead";
    return state === "connect" && lit.has(finger) ? "seen" : "open";
  }

  return station.on("full", draw);
}

function chip(finger, standing, moving) {
  return h(
    "li",
    { class: `${standing} ${moving ? "lit" : ""}` },
    h("span", { "aria-hidden": "true" }, SIGN[standing] && icon(SIGN[standing])),
    h("span", {}, t(`finger.${finger}`)),
    h("span", { class: "visually-hidden" }, t(`check.${standing}`)),
  );
}

/** What the check found. */
function verdicts({ moved, exchange }, faults) {
  const part = (finger) => t(`part.${finger}`);
  const words = ({ strip, finger }) => ({ strip: part(strip), finger: part(finger) });
  const known = exchange.map((one) => one.finger);
  const rest = Object.entries(moved).filter(([finger, strip]) => strip !== finger && !known.includes(finger));
  const problems = [
    exchange.length === 2 && t("check.exchanged", { one: part(exchange[0].finger), other: part(exchange[0].strip) }),
    exchange.length > 2 && t("check.round", { list: exchange.map((one) => t("check.worn", words(one))).join(", ") }),
    ...rest.map(([finger, strip]) =>
      strip ? t("check.other", { finger: part(finger), strip: part(strip) }) : t("check.silent", { finger: part(finger) }),
    ),
    ...faults.map(inWords),
  ].filter(Boolean);
  if (!problems.length) return [h("p", { class: "good-words" }, t("check.fine"))];
  return problems.map((text) => h("p", { class: "warning" }, text));
}
