/** The tones of a task, made in the browser: for each of the last three seconds before it, a longer one at its start, two at its end. */
import { makeOnset } from "./metronome_time.js";

const AHEAD = 0.4; // s that a tone is made ready before it is due
const LATE = 0.15; // s after which it is better left out
const COUNT = { hertz: 660, length: 0.12 };
const START = { hertz: 990, length: 0.5 };
const STOP = [
  { hertz: 784, length: 0.25, after: 0 },
  { hertz: 523, length: 0.5, after: 0.22 },
];
const SECONDS = [3, 2, 1];

/** `clicks` as makeClicks gives it; `now` in s. */
export function makeCueTones(clicks, now = () => performance.now() / 1000) {
  const onset = makeOnset();
  let stage = ""; // "count" before a task starts, "run" while it goes on, else ""
  let due = []; // tones still to come: { at, hertz, length } by this page's clock
  let zero = 0; // s, when the countdown or the task ends
  let ended = false; // the task's end has sounded

  /** Hear of a stage with the seconds that remain of it, null where nobody knows. */
  function take(next, remaining) {
    if (next !== stage) enter(next);
    if (!stage || remaining === null) return;
    zero = onset.addMessage(now(), -remaining);
    for (const tone of due) tone.at = zero + tone.after;
    ring();
  }

  function enter(next) {
    if (due.length) clicks.silence(); // a countdown that was broken off
    onset.reset();
    if (stage === "run" && !next && !ended) STOP.forEach(({ hertz, length, after }) => clicks.tone(after, hertz, length));
    if (next === "count") due = [...SECONDS.map((left) => ({ ...COUNT, after: -left })), { ...START, after: 0 }];
    else if (next === "run") [due, ended] = [STOP.map((tone) => ({ ...tone })), false];
    else due = [];
    stage = next;
  }

  function ring() {
    for (const tone of [...due]) {
      const wait = tone.at - now();
      if (wait > AHEAD) continue;
      due.splice(due.indexOf(tone), 1);
      if (wait > -LATE) clicks.tone(Math.max(0, wait), tone.hertz, tone.length);
      if (stage === "run") ended = true;
    }
  }

  return { take };
}
