/** Time of a paced movement: its `cycle`, [{ say, seconds }], is repeated `repetitions` times from 0 s on. */

export const period = (cycle) => cycle.reduce((sum, phase) => sum + phase.seconds, 0);

/** The phase at `elapsed` s: { repetition (from 1), phase (index), left (s of the phase) }; null before the first and after the last. */
export function placeAt({ cycle, repetitions }, elapsed) {
  const whole = period(cycle);
  if (!(elapsed >= 0 && elapsed < whole * repetitions)) return null;
  const round = Math.floor(elapsed / whole);
  let left = elapsed - round * whole;
  let phase = 0;
  while (phase < cycle.length - 1 && left >= cycle[phase].seconds) left -= cycle[phase++].seconds;
  return { repetition: round + 1, phase, left: cycle[phase].seconds - left };
}

/** Whether there is nothing to count: one movement of one part. */
export const isSingle = ({ cycle, repetitions }) => repetitions === 1 && cycle.length === 1;

/** Which movement it is, and of how many; of a single round its parts are counted. */
export const countAt = ({ cycle, repetitions }, { repetition, phase }) =>
  repetitions > 1 ? [repetition, repetitions] : [phase + 1, cycle.length];

/** Beat number k (from 0): when it is due (`at`, s), and whether a movement begins with it; null after the last. */
export function beatAt({ cycle, repetitions }, k) {
  const round = Math.floor(k / cycle.length);
  if (round >= repetitions) return null;
  const phase = k % cycle.length;
  return { at: round * period(cycle) + period(cycle.slice(0, phase)), first: phase === 0 };
}

/**
 * When something began by this page's clock, from messages that say how long ago it began. A message can only be late,
 * so the earliest of the newest few is the best estimate.
 */
export function makeOnset(window = 10) {
  let messages = [];
  return {
    /** Add a message that says "`ago` s before `now` s"; returns the best estimate of the start. */
    addMessage(now, ago) {
      messages = [...messages.filter((one) => now - one.now < window), { now, began: now - ago }];
      return Math.min(...messages.map((one) => one.began));
    },
    reset: () => (messages = []),
  };
}
