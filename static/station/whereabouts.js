/** Where the hand is, seen from the trunk, where a magnet tells it: shown with how sure it is and what the magnet's signal means. */
import { h, whenChanged } from "../dom.js";
import { decimal, t } from "../words/words.js";

export function mount(root, api, { station }) {
  const heading = h("h2", {}, t("place.title"));
  const list = h("dl", {});
  const doubts = h("p", { class: "warning", role: "status" });
  const meaning = h("p", { class: "hint" }, t("place.signal.means"));
  root.append(heading, list, doubts, meaning);
  const draw = whenChanged(
    ({ place }) => place,
    (place) => {
      root.hidden = !place;
      if (!place) return;
      const said = [place.reason, ...(place.doubts ?? [])].filter(Boolean);
      doubts.hidden = !said.length;
      doubts.textContent = said.join(". ");
      meaning.hidden = place.signal_db == null;
      list.replaceChildren(...rows(place).map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
    },
  );
  return station.on("full", draw);
}

function rows({ mm, distance_mm: distance, sd_mm: sd, signal_db: signal }) {
  const found = [];
  if (mm) {
    const [forward, up, right] = mm.map((x) => decimal(Math.round(x / 10) + 0, 0));
    found.push([t("place.distance"), t("place.sure", { value: decimal(distance / 10, 1), sd: decimal(sd / 10, 1) })]);
    found.push([t("place.where"), t("place.axes", { forward, up, right })]);
  }
  if (signal != null) found.push([t("place.signal"), `${decimal(signal, 1)} dB`]);
  return found;
}
