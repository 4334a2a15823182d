/** The metronome's sound: short clicks at exact moments. A browser gives sound only after somebody has pressed something on the page. */

const HIGH = 1760; // Hz, where a movement begins
const LOW = 1175;
const LENGTH = 0.06; // s
const LOUD = 0.5;
const KEY = "handscope-metronome";

/** `changed` hears of every change of `state`: "on", "off" (by choice) or "blocked" (by the browser). */
export function makeClicks(changed) {
  let audio = null;
  let wanted = recalled();
  let ahead = []; // clicks that may not have sounded yet
  let needed = false; // a task with a metronome is open, or was

  function state() {
    return wanted ? (audio?.state === "running" ? "on" : "blocked") : "off";
  }

  /** Sound made ready; in what a press calls, the browser allows it. */
  function open() {
    if (!wanted || !needed || !("AudioContext" in window)) return;
    audio ??= listened(new AudioContext({ latencyHint: "interactive" }));
    if (audio.state !== "running") audio.resume().catch(() => {}); // still blocked: `state` says so
  }

  function listened(context) {
    context.onstatechange = changed;
    return context;
  }

  /** A click in `wait` s. */
  function click(wait, high) {
    if (state() !== "on") return;
    const at = audio.currentTime + Math.max(0, wait - (audio.outputLatency || 0));
    const [tone, gain] = [audio.createOscillator(), audio.createGain()];
    tone.frequency.value = high ? HIGH : LOW;
    gain.gain.setValueAtTime(LOUD, at);
    gain.gain.exponentialRampToValueAtTime(0.001, at + LENGTH);
    tone.connect(gain).connect(audio.destination);
    tone.start(at);
    tone.stop(at + LENGTH);
    ahead = [...ahead.filter((one) => one.at > audio.currentTime), { tone, at }];
  }

  /** Take back what has not sounded yet. */
  function silence() {
    ahead.filter((one) => one.at > audio.currentTime).forEach((one) => one.tone.stop());
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
    silence,
    set(on) {
      if (!on) silence();
      wanted = on;
      remember(on);
      open();
      changed();
    },
    close() {
      if (audio) audio.onstatechange = null;
      audio?.close();
    },
  };
}

function recalled() {
  try {
    return localStorage.getItem(KEY) !== "off";
  } catch {
    return true; // a browser that keeps nothing
  }
}

function remember(on) {
  try {
    localStorage.setItem(KEY, on ? "on" : "off");
  } catch {
    // it holds until the page is left
  }
}
