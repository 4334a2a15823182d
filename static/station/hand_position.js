/** Position of the hand from the trunk, by a magnet: with its standard deviation and the strength of its signal. */
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
      const problems = [place.reason, ...(place.doubts ?? [])].filter(Boolean);
      doubts.hidden = !problems.length;
      doubts.textContent = problems.join(". ");
      meaning.hidden = place.signal_db == null;
      list.replaceChildren(...rows(place).map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
    },
  );
  return station.on("full", draw);
}

function rows({ mm, distance_mm: distance, sd_mm: sd, signal_db: signal }) {
  const entries = [];
  if (mm) {
    const [forward, up, right] = mm.map((x) => decimal(Math.round(x / 10) + 0, 0));
    entries.push([t("place.distance"), t("place.sure", { value: decimal(distance / 10, 1), sd: decimal(sd / 10, 1) })]);
    entries.push([t("place.where"), t("place.axes", { forward, up, right })]);
  }
  if (signal != null) entries.push([t("place.signal"), `${decimal(signal, 1)} dB`]);
  return entries;
}
