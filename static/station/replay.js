/** A replay: the 3-D hand with a time line, curves beside it, and the tasks to jump to. */
import { assemble, h, icon } from "../dom.js";
import { errorBox } from "../forms.js";
import * as angles from "./angles.js";
import * as chapterList from "./replay_chapters.js";
import * as controls from "./replay_controls.js";
import * as curves from "./replay_curves.js";
import { makeFocus } from "./replay_focus.js";
import { dayAndTime, t } from "../words/words.js";

export function mount(root, api, { station, session, strip }) {
  const box = errorBox();
  const back = `/sessions/${session.id}?result=${station.latest.result}`;
  const pair = h("p", { class: "pair", hidden: true });
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
    h("a", { class: "button", href: back }, icon("chevron-left"), t("replay.back")),
    h("h1", {}, t("replay.title")),
    h(
      "p",
      { class: "soft" },
      t("replay.lead", { who: t("station.who", { hand: t(`hand.${station.latest.hand}.title`), patient: session.patient.pseudonym }) }),
      " ",
      t("replay.keys"),
    ),
    pair,
    box.element,
    places.chapters,
    places.angles,
  );
  if (station.latest.beside) namesOf(api, station.latest).then((names) => pair.replaceChildren(...names), box.show);
  pair.hidden = !station.latest.beside;
  Promise.all([api.get(`/api/results/${station.latest.result}?lean=true`), api.titles().catch(() => new Map())]).then(
    ([result, titles]) => {
      if (gone) return;
      const focus = makeFocus(station);
      const chapters = chapterList.chaptersOf(result, titles);
      const parts = [
        [controls, places.controls],
        [curves, places.curves],
        [chapterList, places.chapters],
        [angles, places.angles],
      ];
      const unmount = assemble(api, { station, result, focus, chapters }, parts);
      root.append(focus.element);
      leave = () => {
        unmount();
        focus.leave();
      };
      places.angles.querySelector("details").open = true;
    },
    (error) => gone || box.show(error),
  );
  return () => {
    gone = true;
    leave();
  };
}

/** Which hand is which: the left one in the picture is this session's; by methods where both are of one recording. */
async function namesOf(api, { session, result, beside, hand }) {
  const results = await Promise.all([result, beside.result].map((id) => api.get(`/api/results/${id}?lean=true`)));
  const sessions = await Promise.all([session, beside.session].map((id) => api.get(`/api/sessions/${id}`)));
  const sides = [hand, beside.hand];
  const alone = results[0].recording === results[1].recording;
  const words = (k) =>
    alone
      ? t("replay.by_method", results[k])
      : t("compare.session", { day: dayAndTime(sessions[k].started), hand: t(`hand.${sides[k]}.title`) });
  return ["left", "right"].map((place, k) => h("span", {}, h("strong", {}, t(`replay.on_the_${place}`)), " ", words(k)));
}
