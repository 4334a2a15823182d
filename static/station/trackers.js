/** Trackers of a source: which one sits on which segment; the one that is shaken or tapped lights up. */
import { h, whenChanged } from "../dom.js";
import { errorBox, select } from "../forms.js";
import { segmentWords } from "../words/clinical.js";
import { t } from "../words/words.js";

const CHAINS = { thumb: ["metacarpal", "proximal", "distal"], other: ["proximal", "middle", "distal"] };
const FINGERS = ["thumb", "index", "middle", "ring", "little"];
const SEGMENTS = [
  "forearm",
  "hand",
  ...FINGERS.flatMap((finger) => (CHAINS[finger] ?? CHAINS.other).map((piece) => `${finger}_${piece}`)),
];
const WEAK = -75; // dBm

export function mount(root, api, { station }) {
  const box = errorBox();
  const body = h("tbody", {});
  const columns = ["trackers.tracker", "trackers.segment", "trackers.state"].map((word) => h("th", { scope: "col" }, t(word)));
  const lead = h("p", { class: "small soft" });
  const details = h(
    "details",
    {},
    h("summary", {}, t("trackers.title")),
    lead,
    h("table", { class: "compact" }, h("thead", {}, h("tr", {}, columns)), body),
    box.element,
  );
  root.append(details);
  let rows = new Map(); // by tracker: row, cell of its state

  const drawTable = whenChanged(
    ({ trackers, wizard }) => [trackers.map(({ sensor, place }) => [sensor, place]), wizard.state === "connect"],
    ([places, open]) => {
      root.hidden = !places.length;
      details.open = open;
      lead.textContent = t(open ? "trackers.lead" : "trackers.fixed");
      const focused = body.contains(document.activeElement) ? document.activeElement.getAttribute("data-tracker") : null;
      rows = new Map(places.map(([sensor, place]) => [sensor, row(sensor, place, open)]));
      body.replaceChildren(...[...rows.values()].map(([element]) => element));
      if (focused) body.querySelector(`select[data-tracker="${CSS.escape(focused)}"]`)?.focus();
    },
  );
  const drawStates = whenChanged(
    ({ trackers }) => trackers,
    (trackers) =>
      trackers.forEach((tracker) => {
        const [element, state] = rows.get(tracker.sensor);
        element.className = tracker.moving || tracker.tapped ? "lit" : "";
        state.textContent = words(tracker);
      }),
  );

  function row(sensor, place, open) {
    const options = [["", t("trackers.not_worn")], ...SEGMENTS.map((segment) => [segment, segmentWords(segment)])];
    const choice = select(options, place, {
      "aria-label": t("trackers.on", { tracker: sensor }),
      "data-tracker": sensor,
      disabled: !open,
      onchange: ({ target }) => change(sensor, target.value),
    });
    const state = h("td", { class: "small" });
    return [h("tr", {}, h("th", { scope: "row" }, sensor), h("td", {}, choice), state), state];
  }

  async function change(sensor, segment) {
    box.clear();
    await api.put(`/api/stations/${station.name}/trackers`, { places: { [sensor]: segment } }).catch(box.show);
  }

  const leave = [station.on("full", drawTable), station.on("full", drawStates)];
  return () => leave.forEach((stop) => stop());
}

function words({ moving, tapped, battery, signal }) {
  return [
    tapped ? t("trackers.tapped") : moving && t("trackers.moving"),
    battery !== null && t("trackers.battery", { percent: battery }),
    signal !== null && t(signal <= WEAK ? "trackers.weak" : "trackers.signal", { dbm: signal }),
  ]
    .filter(Boolean)
    .join(", ");
}
