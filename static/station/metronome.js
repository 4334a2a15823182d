/** The metronome over the scene: a lamp that lights with each beat, the word of the phase, which movement it is, and a switch for sound. */
import { h, lasting, whenChanged, write } from "../dom.js";
import { beatAt, countAt, isSingle, makeOnset, placeAt } from "./metronome_time.js";
import { makeClicks } from "./clicks.js";
import { t } from "../words/words.js";

const COUNTING = ["countdown", "resume_countdown", "step_countdown"];
const RUNNING = ["task_run", "step_run"];
const SHOWN = ["task_ready", "step_ready", ...COUNTING, ...RUNNING];
const PAUSE = 50; // ms between two looks at which clicks are due
const AHEAD = 1; // s that a click is made ready before it is due: a busy page may be late itself
const LONG_WORD = 9; // letters that fit in a line of the lamp
const LATE = 0.1; // s after which it is better left out
const FLASH = 0.15; // s that the lamp is bright
const LONG = 3; // s: a phase at least as long has a countdown of its own
const COUNTED = ["repetitions", "taps"];
const FIRST = { repetition: 1, phase: 0 };
const QUIET = 500; // ms that a browser may take to begin with sound

export function mount(root, api, { station }) {
  const word = h("span", { class: "say" });
  const left = h("span", { class: "left" });
  const lamp = h("div", { class: "beat" }, word, left);
  const count = h("span", { class: "count" });
  const shown = h("div", { class: "shown", "aria-hidden": "true" }, lamp, count); // words with every beat would talk over the wizard's
  const sound = h("button", { class: "sound", onclick: () => clicks.set(clicks.state() !== "on") });
  const note = h("p", { class: "small", role: "status" });
  root.append(shown, sound, note);
  const clicks = makeClicks(drawSound);
  const blocked = lasting(QUIET);
  const onset = makeOnset();
  const now = () => performance.now() / 1000;
  let pace = null; // of the task that is about to run or runs
  let zero = null; // s by this page's clock at which it begins
  let begins = 0; // s of the trial: after a pause it goes on from there
  let next = 0; // the beat to be made ready
  let frame = 0;

  function take({ wizard, glove, numbers }) {
    pace = SHOWN.includes(wizard.state) ? wizard.pace : null;
    const paced = Boolean(pace?.cycle.length);
    count.hidden = paced && isSingle(pace);
    drawKind([paced, paced || Boolean(pace?.repetitions), wizard.state]);
    const ago = COUNTING.includes(wizard.state) ? pace?.begins - wizard.remaining : RUNNING.includes(wizard.state) ? pace?.elapsed : null;
    if (COUNTING.includes(wizard.state)) begins = pace?.begins ?? 0;
    if (paced && ago !== null && glove.flowing) zero = onset.addMessage(now(), ago);
    else halt();
    if (paced) drawNote(blocked(clicks.state() === "blocked"));
    else if (pace?.repetitions) drawCount(RUNNING.includes(wizard.state) ? (numbers.find((n) => COUNTED.includes(n.name))?.value ?? 0) : 0);
    frame ||= requestAnimationFrame(draw);
  }

  /** Nothing moves, or samples do not arrive: no beat either. */
  function halt() {
    if (zero === null) return;
    onset.reset();
    clicks.silence();
    [zero, next] = [null, 0];
  }

  const drawKind = whenChanged(
    (picked) => picked,
    ([paced, any, state]) => {
      root.hidden = !any;
      lamp.hidden = sound.hidden = !paced;
      note.hidden = true;
      root.dataset.state = state;
      if (!paced) return;
      clicks.need();
      drawSound();
    },
  );

  function drawSound() {
    const on = clicks.state() !== "off";
    sound.textContent = t(on ? "metronome.sound.on" : "metronome.sound.off");
    sound.setAttribute("aria-pressed", String(on));
  }

  function drawNote(is) {
    if (note.hidden !== is) return;
    note.hidden = !is;
    note.textContent = is ? t("metronome.blocked") : "";
  }

  function drawCount(done, all = pace.repetitions) {
    write(count, t("metronome.count", { done, all }));
  }

  /** The light, with every picture of the screen while it beats. */
  function draw() {
    frame = 0;
    if (!pace?.cycle.length) return;
    const place = zero === null || now() - zero < begins ? null : placeAt(pace, now() - zero);
    const coming = place ?? (zero === null ? null : placeAt(pace, begins)); // with what it begins, or goes on
    const phase = pace.cycle[coming?.phase ?? 0];
    write(word, phase.say);
    word.classList.toggle("long", phase.say.length > LONG_WORD);
    write(left, place && phase.seconds >= LONG ? String(Math.ceil(place.left)) : "");
    lamp.classList.toggle("first", place?.phase === 0);
    lamp.classList.toggle("bright", place !== null && phase.seconds - place.left < FLASH);
    const [done, all] = countAt(pace, coming ?? FIRST);
    drawCount(place ? done : done - 1, all); // what is being done counts
    if (zero !== null) frame = requestAnimationFrame(draw);
  }

  /** Clicks that are due soon. */
  function ring() {
    if (zero === null || !pace) return;
    for (let due = beatAt(pace, next); due && zero + due.at - now() < AHEAD; due = beatAt(pace, (next += 1))) {
      const wait = zero + due.at - now();
      if (wait > -LATE && due.at > begins - LATE) clicks.click(wait, due.first);
    }
  }

  const leave = station.on("full", take);
  const timer = setInterval(ring, PAUSE);
  const pressed = ({ target }) => sound.contains(target) || clicks.open(); // a browser allows sound from the first press on
  const presses = ["pointerdown", "keydown"];
  presses.forEach((press) => document.addEventListener(press, pressed));
  return () => {
    leave();
    clearInterval(timer);
    cancelAnimationFrame(frame);
    presses.forEach((press) => document.removeEventListener(press, pressed));
    clicks.close();
  };
}
