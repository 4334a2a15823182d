/** What a task measures, with its number, where the scene itself cannot show it: in a mirrored picture digits would be reversed. */
import { h, whenChanged } from "../dom.js";
import { curveWords, valueWords } from "../words/clinical.js";

export function mount(root, api, { station }) {
  const name = h("span", {});
  const value = h("strong", {});
  root.append(name, value);
  root.setAttribute("aria-hidden", "true"); // the curve and the list of angles are read out
  const draw = whenChanged(
    ({ mirrored, measured }) => [mirrored, measured],
    ([mirrored, measured]) => {
      root.hidden = !mirrored || !measured;
      if (measured) name.textContent = curveWords(measured);
    },
  );
  const take = ({ points, what }) => {
    if (!root.hidden && points.length) value.textContent = valueWords(what, points[points.length - 1][1]);
  };
  const leave = [station.on("full", draw), station.on("pulse", take)];
  return () => leave.forEach((stop) => stop());
}
