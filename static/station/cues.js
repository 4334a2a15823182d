/** The tones of countdown, start and end, and their switch where the metronome has none. */
import { h, whenChanged } from "../dom.js";
import { makeClicks } from "./clicks.js";
import { makeCueTones } from "./cue_tones.js";
import { t } from "../words/words.js";

const STAGE = {
  countdown: "count",
  resume_countdown: "count",
  step_countdown: "count",
  free_countdown: "count",
  task_run: "run",
  step_run: "run",
  free_run: "run",
};
const OFFERED = ["task_ready", "step_ready", "free_ready"]; // states in which the switch is of use

export function mount(root, api, { station }) {
  const sound = h("button", { class: "sound", onclick: () => clicks.set(clicks.state() === "off") });
  const clicks = makeClicks(draw);
  const tones = makeCueTones(clicks);
  root.append(sound);

  function draw() {
    const on = clicks.state() !== "off";
    sound.textContent = t(on ? "metronome.sound.on" : "metronome.sound.off");
    sound.setAttribute("aria-pressed", String(on));
  }

  const drawKind = whenChanged(
    ({ wizard }) => [STAGE[wizard.state] || OFFERED.includes(wizard.state), Boolean(wizard.pace?.cycle.length)],
    ([of_use, paced]) => {
      root.hidden = !of_use || paced; // the metronome has the same switch
      if (of_use) clicks.need();
      draw();
    },
  );
  const take = (full) => {
    drawKind(full);
    tones.take(full.glove.flowing ? (STAGE[full.wizard.state] ?? "") : "", full.wizard.remaining);
  };
  const pressed = ({ target }) => sound.contains(target) || clicks.open(); // a browser allows sound from the first press on
  const presses = ["pointerdown", "keydown"];
  presses.forEach((press) => document.addEventListener(press, pressed));
  const leave = station.on("full", take);
  return () => {
    leave();
    presses.forEach((press) => document.removeEventListener(press, pressed));
    clicks.close();
  };
}
