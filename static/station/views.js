/** From which side everybody sees the hand: a row of buttons in the scene, one of them for a mirrored picture. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { t } from "../words/words.js";

const SIDES = ["own", "front", "back", "thumb", "little", "palm", "fit"];

export function mount(root, api, { station, scene }) {
  const box = errorBox();
  const path = `/api/stations/${station.name}/view`;
  const button = (name, wanted, more = {}) => {
    const press = () => once(made, box, () => api.post(path, wanted()));
    const made = h("button", { ...more, title: t(`view.${name}.title`), "data-view": name, onclick: press }, t(`view.${name}`));
    return made;
  };
  const mirror = button("mirror", () => ({ mirrored: !station.latest.mirrored }), { "aria-pressed": "false" });
  root.setAttribute("role", "toolbar");
  root.setAttribute("aria-label", t("view.label"));
  root.append(...SIDES.map((side) => button(side, () => ({ side }))), mirror, box.element);
  const draw = whenChanged(
    ({ mirrored }) => mirrored,
    (mirrored) => {
      scene.classList.toggle("mirrored", mirrored);
      mirror.setAttribute("aria-pressed", String(mirrored));
    },
  );
  return station.on("full", draw);
}
