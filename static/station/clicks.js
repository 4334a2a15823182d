/** Sound at exact moments: clicks of the metronome, tones of a countdown. A browser gives sound only after a press on the page. */

const HIGH = 1760; // Hz, where a movement begins
const LOW = 1175;
const LENGTH = 0.06; // s
const LOUD = 0.5;
const KEY = "handscope-metronome";
const chosen = new Map(); // by key, on this page: also where the browser keeps nothing

/**
 * `changed` hears of every change of `state`: "on", "off" (by choice) or "blocked" (by the browser).
 * All sounds with the same `key` have one switch, which is `usual` before anybody used it.
 */
export function makeClicks(changed, key = KEY, usual = true) {
  let audio = null;
  const recalled = () => chosen.get(key) ?? kept(key) ?? usual;
  let ahead = []; // clicks that may not have sounded yet
  let needed = false; // a task with a metronome is open, or was

  function state() {
    return recalled() ? (audio?.state === "running" ? "on" : "blocked") : "off";
  }

  /** Sound made ready; in what a press calls, the browser allows it. */
  function open() {
    if (!recalled() || !needed || !("AudioContext" in window)) return;
    audio ??= listened(new AudioContext({ latencyHint: "interactive" }));
    if (audio.state !== "running") audio.resume().catch(() => {}); // still blocked: `state` says so
  }

  function listened(context) {
    context.onstatechange = changed;
    return context;
  }

  /** A click in `wait` s. */
  const click = (wait, high) => tone(wait, high ? HIGH : LOW, LENGTH);

  /** A tone of `hertz` in `wait` s, which fades away in `length` s. */
  function tone(wait, hertz, length) {
    if (state() !== "on") return;
    const at = audio.currentTime + Math.max(0, wait - (audio.outputLatency || 0));
    const [made, gain] = [audio.createOscillator(), audio.createGain()];
    made.frequency.value = hertz;
    gain.gain.setValueAtTime(LOUD, at);
    gain.gain.exponentialRampToValueAtTime(0.001, at + length);
    made.connect(gain).connect(audio.destination);
    made.start(at);
    made.stop(at + length);
    ahead = [...ahead.filter((one) => one.at > audio.currentTime), { made, at }];
  }

  /** Take back what has not sounded yet. */
  function silence() {
    ahead.filter((one) => one.at > audio.currentTime).forEach((one) => one.made.stop());
    ahead = [];
  }

  return {
    state,
    open,
    need() {
      needed = true;
      open();
    },
    click,
    tone,
    silence,
    set(on) {
      if (!on) silence();
      remember(key, on);
      open();
      changed();
    },
    close() {
      if (audio) audio.onstatechange = null;
      audio?.close();
    },
  };
}

function kept(key) {
  try {
    const word = localStorage.getItem(key);
    return word === null ? null : word !== "off";
  } catch {
    return null; // a browser that keeps nothing
  }
}

function remember(key, on) {
  chosen.set(key, on);
  try {
    localStorage.setItem(key, on ? "on" : "off");
  } catch {
    // it holds until the page is left
  }
}
