/** A replay: the 3-D hand with a time line, curves beside it, and the tasks to jump to. */
import { assemble, h } from "../dom.js";
import { errorBox } from "../forms.js";
import * as angles from "./angles.js";
import * as chapters from "./chapters.js";
import * as controls from "./controls.js";
import * as curves from "./replay_curves.js";
import { t } from "../words/words.js";

export function mount(root, api, { station, session, strip }) {
  const box = errorBox();
  const back = `/sessions/${session.id}?result=${station.latest.result}`;
  const places = {
    controls: h("div", { class: "controls" }),
    curves: h("div", { class: "curves" }),
    chapters: h("section", { class: "chapters" }),
    angles: h("section", { class: "angles" }),
  };
  let leave = () => {};
  let gone = false;
  strip.classList.add("tall");
  strip.append(places.controls, places.curves);
  root.append(
    h("a", { class: "button", href: back }, "‹ ", t("replay.back")),
    h("h1", {}, t("replay.title")),
    h(
      "p",
      { class: "soft" },
      t("replay.lead", { who: t("station.who", { hand: t(`hand.${station.latest.hand}.title`), patient: session.patient.pseudonym }) }),
    ),
    box.element,
    places.chapters,
    places.angles,
  );
  api.get(`/api/results/${station.latest.result}`).then(
    (result) => {
      if (gone) return;
      const parts = [
        [controls, places.controls],
        [curves, places.curves],
        [chapters, places.chapters],
        [angles, places.angles],
      ];
      leave = assemble(api, { station, result }, parts);
      places.angles.querySelector("details").open = true;
    },
    (error) => gone || box.show(error),
  );
  return () => {
    gone = true;
    leave();
  };
}
