/** Where a paced movement stands, by the clock alone: its `cycle`, [{ say, seconds }], is gone through `repetitions` times from 0 s on. */

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

/** Beat number k (from 0): when it is due (`at`, s), and whether a movement begins with it; null after the last. */
export function beat({ cycle, repetitions }, k) {
  const round = Math.floor(k / cycle.length);
  if (round >= repetitions) return null;
  const phase = k % cycle.length;
  return { at: round * period(cycle) + period(cycle.slice(0, phase)), first: phase === 0 };
}

/**
 * When something began by this page's clock, from messages that each say how long ago it was. A message can only be late, so the earliest
 * of the newest few is nearest to the truth.
 */
export function makeOnset(kept = 10) {
  let heard = [];
  return {
    /** `ago` s before `now` s, as a message that just came says; gives the best guess. */
    hear(now, ago) {
      heard = [...heard.filter((one) => now - one.now < kept), { now, began: now - ago }];
      return Math.min(...heard.map((one) => one.began));
    },
    forget: () => (heard = []),
  };
}
