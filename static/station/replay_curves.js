/** Curves of the whole recording with a cursor in step with the 3-D hand; a press on them jumps there. */
import { h } from "../dom.js";
import { errorBox, select } from "../forms.js";
import { legend } from "../plots/legend.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, distinctWords, valueWords } from "../words/clinical.js";
import { clock, t } from "../words/words.js";

const FINGERS = ["index", "middle", "ring", "little"];
const SETS = {
  aperture: ["aperture"],
  thumb: ["thumb_cmc_flexion", "thumb_mcp_flexion", "thumb_ip_flexion"],
  ...Object.fromEntries(FINGERS.map((finger) => [finger, ["mcp", "pip", "dip"].map((joint) => `${finger}_${joint}_flexion`)])),
  spread: FINGERS.map((finger) => `${finger}_mcp_deviation`),
  thumb_base: ["thumb_cmc_flexion", "thumb_cmc_deviation", "thumb_cmc_pronation"],
  wrist: ["wrist_flexion", "wrist_deviation"],
};
const LINES = [
  { colour: "--curve-1" },
  { colour: "--curve-2", dash: [8, 4] },
  { colour: "--curve-3", dash: [2, 3] },
  { colour: "--curve-4", dash: [12, 3, 2, 3] },
];

export function mount(root, api, { station, result }) {
  const { start } = station.latest.replay;
  const box = errorBox();
  const tapped = result.readings.tapping.length > 0;
  const choice = select(
    Object.keys(SETS).map((name) => [name, t(`set.${name}`)]),
    tapped ? "aperture" : "index",
    { "aria-label": t("curves.choose"), onchange: draw },
  );
  const place = h("div", {});
  const names = h("div", {});
  const cursor = h("div", { class: "cursor" });
  let plot = null;
  let asked = 0;
  let at = start;
  root.append(h("div", { class: "curves-head" }, choice, names), place, box.element);

  async function draw() {
    const mine = (asked += 1);
    const shown = SETS[choice.value];
    try {
      const told = await api.get(`/api/results/${result.id}/curves?${shown.map((what) => `what=${what}`).join("&")}`);
      if (mine !== asked) return;
      box.clear();
      plot?.destroy();
      names.replaceChildren(shown.length > 1 ? legend(shown.map((what) => distinctWords(what, shown))) : "");
      plot = makePlot(place, {
        label: shown.map(curveWords).join(", "),
        lines: LINES.slice(0, shown.length),
        words: (value) => valueWords(shown[0], value),
        xWords: (moment) => clock(moment - start),
        axis: 96,
        drawn: point,
        pressed: (moment) => station.act("seek", { value: moment }).catch((error) => box.show(error)),
      });
      plot.set([told.t, ...shown.map((what) => told.curves[what])]);
    } catch (error) {
      if (mine === asked) box.show(error);
    }
  }

  /** The cursor over the plot at the moment shown. */
  function point() {
    const drawn = plot?.plot;
    if (!drawn) return;
    if (cursor.parentNode !== drawn.over) drawn.over.append(cursor);
    cursor.style.transform = `translateX(${drawn.valToPos(at, "x")}px)`;
    cursor.dataset.t = at.toFixed(2);
  }

  const leave = station.on("pulse", (pulse) => {
    at = pulse.t;
    point();
  });
  draw();
  return () => {
    asked += 1;
    leave();
    plot?.destroy();
  };
}
