/** The glove: strips found and missing, rate, losses, and whatever else needs attention, in plain words. */
import { h, paced, whenChanged } from "../dom.js";
import { deviceWords, stripWords } from "../words/clinical.js";
import { counted, decimal, t, whole } from "../words/words.js";

const STRIPS = ["hand", "thumb", "index", "middle", "ring", "little", "forearm"];
const BESIDE = ["trunk", "trunk_mag", "fingertips_force"]; // streams of other strips
const PAUSE = 500; // ms: rates and counts are read, not watched
const UNKNOWN_BATTERY = 255; // on USB power

export function mount(root, api, { station }) {
  const state = h("span", { class: "badge" });
  const lead = h("p", { class: "small soft" });
  const felt = h("div", { class: "small soft" });
  const rows = h("tbody", {});
  const attention = h("ul", { class: "small" });
  const columns = ["glove.strip", "glove.rate", "glove.lost"].map((word) => h("th", { scope: "col" }, t(word)));
  const box = h(
    "details",
    {},
    h("summary", {}, t("glove.title"), state),
    lead,
    attention,
    h("table", { class: "compact" }, h("thead", {}, h("tr", {}, columns)), rows),
    felt,
  );
  root.append(box);

  const drawState = whenChanged(
    ({ glove }) => [notes(glove), STRIPS.filter((strip) => isFound(glove, strip)).length, worn(glove).length, glove.flowing],
    ([problems, count, all, flowing]) => {
      const good = flowing && !problems.length;
      state.className = `badge ${good ? "good" : "warn"}`;
      state.textContent = flowing ? counted(good ? "glove.good" : "glove.attention", count, { all }) : t("glove.silent");
      attention.replaceChildren(...problems.map((words) => h("li", {}, words)));
    },
  );
  const drawRows = whenChanged(
    ({ glove }) => [
      ...STRIPS.map((strip) => row(glove, strip)),
      ...glove.strips.filter((strip) => BESIDE.includes(strip.name)).map(beside),
    ],
    (states) =>
      rows.replaceChildren(
        ...states.map(([words, cells]) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, words),
            cells.map((cell) => h("td", { class: "number" }, cell)),
          ),
        ),
      ),
  );
  const drawLead = whenChanged(
    ({ glove }) => [glove.name, glove.firmware, glove.battery, glove.forces, glove.flowing ? unworn(glove) : []],
    ([name, firmware, battery, forces, without]) => {
      lead.textContent = [
        name && deviceWords(name),
        firmware && t("glove.firmware", { firmware }),
        isCharge(battery) && t("glove.battery", { battery }),
      ]
        .filter(Boolean)
        .join(", ");
      const absent = without.length ? [t("glove.without", { strips: without.map((strip) => t(`strip.${strip}`)).join(", ") })] : [];
      felt.replaceChildren(...[...absent, ...forceWords(forces)].map((words) => h("p", {}, words)));
    },
  );
  const open = whenChanged(
    ({ wizard }) => wizard.state === "connect",
    (connecting) => (box.open = connecting),
  );
  const draw = (full) => {
    drawState(full);
    drawLead(full);
    if (box.open) drawRows(full);
  };
  box.addEventListener("toggle", () => draw(station.latest));
  const leave = [open, paced(PAUSE, draw)].map((take) => station.on("full", take));
  return () => leave.forEach((stop) => stop());
}

/** Whether a glove says how full its battery is: without one, or on USB power, it does not. */
export const isCharge = (battery) => battery !== null && battery !== UNKNOWN_BATTERY;

const isFound = (glove, strip) => glove.measured.some((segment) => segment === strip || segment.startsWith(`${strip}_`));

/** Strips that this glove has or had in this session; a glove without the hand's cannot be used. */
const worn = (glove) => STRIPS.filter((strip) => strip === "hand" || isFound(glove, strip) || glove.expected.includes(strip));

const unworn = (glove) => STRIPS.filter((strip) => !worn(glove).includes(strip));

/** The same of a strip that the hand's segments do not wear. */
const beside = ({ name, rate, lost }) => [stripWords(name), [t("unit.per_second_of", { rate: Math.round(rate) }), whole(lost)]];

/** Which fingertips feel forces, and whether their sensors were calibrated. */
function forceWords(forces) {
  const fingers = (some) => some.map(({ finger }) => t(`strip.${finger}`)).join(", ");
  const [sure, unsure] = [forces.filter((f) => f.percent !== null), forces.filter((f) => f.percent === null)];
  return [
    sure.length && t("glove.forces.calibrated", { fingers: fingers(sure), percent: decimal(Math.max(...sure.map((f) => f.percent)), 1) }),
    unsure.length && t("glove.forces.uncalibrated", { fingers: fingers(unsure) }),
  ].filter(Boolean);
}

/** Name, and rate and losses of a strip, or that there is none. */
function row(glove, strip) {
  const stream = glove.strips.find((s) => s.name === strip);
  const words = t(`strip.${strip}`);
  if (!isFound(glove, strip)) {
    return [words, [t(stream ? "glove.no_signal" : worn(glove).includes(strip) ? "glove.not_found" : "glove.none"), ""]];
  }
  if (!stream) return [words, [t("glove.present"), ""]];
  return [words, [t("unit.per_second_of", { rate: Math.round(stream.rate) }), whole(stream.lost)]];
}

/** What needs attention. */
function notes(glove) {
  const missing = worn(glove).filter((strip) => !isFound(glove, strip)).map((strip) => t(`strip.${strip}`));
  const lost = glove.strips.filter((s) => s.lost > 0).map((s) => stripWords(s.name));
  const saturated = glove.strips.filter((s) => s.saturated > 0).map((s) => stripWords(s.name));
  return [
    missing.length && glove.flowing && t("glove.missing", { strips: missing.join(", ") }),
    lost.length && t("glove.losing", { strips: lost.join(", ") }),
    saturated.length && t("glove.saturated", { strips: saturated.join(", ") }),
    glove.frames_corrupt > 0 && t("glove.corrupt", { count: whole(glove.frames_corrupt) }),
    glove.frames_lost > 0 && t("glove.wire_lost", { count: whole(glove.frames_lost) }),
    glove.overruns > 0 && counted("glove.overruns", glove.overruns),
    glove.dropped_live > 0 && counted("glove.dropped", glove.dropped_live),
    glove.method_failures > 0 && counted("glove.method_failures", glove.method_failures),
    glove.decoding_failures > 0 && counted("glove.decoding_failures", glove.decoding_failures),
    glove.battery !== null && glove.battery < 20 && t("glove.battery_low", { battery: glove.battery }),
  ].filter(Boolean);
}
