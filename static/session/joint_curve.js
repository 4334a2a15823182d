/** A joint's flexion over the recording, shown where somebody presses the joint. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { makePlot } from "../plots/plot.js";
import { curveWords, valueWords } from "../words/clinical.js";
import { t } from "../words/words.js";

/** Gives { show, unmount }. */
export function mount(root, api, { result }) {
  const box = errorBox();
  const [title, place] = [h("h3", {}), h("div", { class: "low" })];
  const element = h("section", { hidden: true, tabindex: "-1" }, title, place, box.element);
  let plot = null;
  root.append(element);
  let asked = "";

  async function show(joint) {
    const what = `${joint}_flexion`;
    asked = what;
    try {
      const { t: moments, curves } = await api.get(`/api/results/${result.id}/curves?what=${what}`);
      if (asked === what) draw(what, moments, curves[what]);
    } catch (error) {
      element.hidden = false;
      box.show(error);
    }
  }

  function draw(what, moments, values) {
    plot?.destroy();
    place.replaceChildren();
    box.clear();
    element.hidden = false;
    title.textContent = t("bars.curve", { what: curveWords(what) });
    plot = makePlot(place, {
      label: title.textContent,
      lines: [{ colour: "--curve-1" }],
      words: (value) => valueWords(what, value),
      xWords: (moment) => t("correct.seconds", { seconds: moment.toFixed(0) }),
      axis: 96,
    });
    plot.set([moments, values]);
    element.focus({ preventScroll: true });
    element.scrollIntoView({ block: "nearest" });
  }

  return { show, unmount: () => ((asked = ""), plot?.destroy()) };
}
