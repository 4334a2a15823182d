/** A live session: the wizard that leads it, the curve under test, and how glove and recording are. */
import { assemble, h, whenChanged } from "../dom.js";
import * as actions from "./actions.js";
import * as angles from "./angles.js";
import * as banner from "./banner.js";
import * as check from "./check.js";
import * as countdown from "./countdown.js";
import * as curve from "./live_curve.js";
import * as ending from "./ending.js";
import * as freeMovement from "./free_movement.js";
import * as glove from "./glove.js";
import * as guidance from "./guidance.js";
import * as joints from "./joints.js";
import * as metronome from "./metronome.js";
import * as numbers from "./numbers.js";
import * as recording from "./recording.js";
import * as score from "./score.js";
import * as stillness from "./stillness.js";
import * as steps from "./steps.js";
import * as tasks from "./tasks.js";
import * as whereabouts from "./whereabouts.js";
import { t } from "../words/words.js";

export function mount(root, api, about) {
  const { scene, strip, station, session } = about;
  const place = (kind, name = "div") => h(name, { class: kind });
  const places = {
    banner: place("banner"),
    recording: place("recording"),
    countdown: place("countdown"),
    metronome: place("metronome"),
    curve: place("curve"),
    numbers: place("numbers"),
  };
  const side = {
    steps: place("steps"),
    guidance: place("guidance"),
    check: place("sensors"),
    stillness: place("stillness"),
    score: place("score"),
    actions: place("actions"),
    free: place("free"),
    ending: place("ending"),
    tasks: place("tasks", "section"),
    whereabouts: place("whereabouts", "section"),
    joints: place("joints", "section"),
    angles: place("angles", "section"),
    glove: place("glove", "section"),
  };
  scene.append(h("div", { class: "over" }, places.banner, places.metronome, places.countdown), places.recording);
  strip.append(places.curve, places.numbers);
  const who = h(
    "h1",
    { class: "who" },
    t("station.who", { hand: t(`hand.${station.latest.hand}.title`), patient: session.patient.pseudonym }),
  );
  root.append(who, ...Object.values(side));
  const parts = [
    [banner, places.banner],
    [recording, places.recording],
    [countdown, places.countdown],
    [metronome, places.metronome],
    [curve, places.curve],
    [numbers, places.numbers],
    [steps, side.steps],
    [guidance, side.guidance],
    [check, side.check],
    [stillness, side.stillness],
    [freeMovement, side.free],
    [score, side.score],
    [actions, side.actions],
    [ending, side.ending],
    [tasks, side.tasks],
    [whereabouts, side.whereabouts],
    [joints, side.joints],
    [angles, side.angles],
    [glove, side.glove],
  ];
  const leave = [
    assemble(api, { ...about, given: { score: null } }, parts),
    station.on(
      "full",
      whenChanged(
        (full) => full.wizard.state,
        () => (root.scrollTop = 0),
      ),
    ),
  ];
  return () => leave.forEach((unmount) => unmount());
}
