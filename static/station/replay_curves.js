/** Curves of the whole recording with a cursor in step with the 3-D hand; a press on them jumps there. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { LINES, SETS, chooseSet, curvesAddress } from "../plots/curve_sets.js";
import { legend } from "../plots/legend.js";
import { around } from "./replay_focus.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, distinctWords, valueWords } from "../words/clinical.js";
import { clock } from "../words/words.js";

const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600]; // s between two texts, which tell no parts of a second

export function mount(root, api, { station, result, focus }) {
  const { start } = station.latest.replay;
  const box = errorBox();
  const tapped = result.readings.tapping.length > 0;
  const choice = chooseSet(tapped, draw);
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
      const payload = await api.get(curvesAddress(result.id, shown, around(focus.near) ?? {}));
      if (mine !== asked) return;
      box.clear();
      plot?.destroy();
      names.replaceChildren(shown.length > 1 ? legend(shown.map((what) => distinctWords(what, shown))) : "");
      plot = makePlot(place, {
        label: shown.map(curveWords).join(", "),
        lines: LINES.slice(0, shown.length),
        words: (value) => valueWords(shown[0], value),
        xWords: (moment) => clock(moment - start),
        xSteps: STEPS,
        axis: 96,
        drawn: point,
        pressed: (moment) => station.act("seek", { value: moment }).catch((error) => box.show(error)),
      });
      plot.set([payload.t, ...shown.map((what) => payload.curves[what])]);
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
  const unfocus = focus.on(draw);
  draw();
  return () => {
    asked += 1;
    leave();
    unfocus();
    plot?.destroy();
  };
}
