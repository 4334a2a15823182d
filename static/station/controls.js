/** The time line: play and pause, where it stands, how fast. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once, select } from "../forms.js";
import { t } from "../words/words.js";

const SPEEDS = ["0.25", "0.5", "1", "2"];

export function mount(root, api, { station }) {
  const { start, stop, speed } = station.latest.replay;
  const box = errorBox();
  const play = h("button", { class: "primary large play", onclick: () => once(play, box, () => station.act(playing ? "pause" : "play")) });
  const slider = h("input", {
    type: "range",
    min: start,
    max: stop,
    step: 0.02,
    "aria-label": t("replay.where"),
    oninput: () => seek(Number(slider.value)),
  });
  const where = h("output", { class: "where" });
  const pace = select(
    SPEEDS.map((value) => [value, t("replay.speed", { value })]),
    String(speed),
    { "aria-label": t("replay.speed.label"), onchange: () => once(pace, box, () => station.act("speed", { value: Number(pace.value) })) },
  );
  let playing = null;
  let [waiting, busy] = [null, false];
  root.append(play, slider, where, pace, box.element);

  const drawPlay = whenChanged(
    (pulse) => pulse.playing,
    (now) => {
      playing = now;
      play.textContent = t(now ? "replay.pause" : "replay.play");
    },
  );

  function take(pulse) {
    drawPlay(pulse);
    if (waiting === null && !busy) slider.value = pulse.t;
    const words = t("replay.time", { now: (pulse.t - start).toFixed(1), all: (stop - start).toFixed(1) });
    if (where.textContent !== words) where.textContent = words;
    slider.setAttribute("aria-valuetext", words);
  }

  /** One request at a time; of the places wished for meanwhile only the newest counts. */
  async function seek(t) {
    waiting = t;
    if (busy) return;
    busy = true;
    try {
      while (waiting !== null) {
        const now = waiting;
        waiting = null;
        await station.act("seek", { value: now });
      }
      box.clear();
    } catch (error) {
      box.show(error);
    } finally {
      busy = false;
    }
  }

  return station.on("pulse", take);
}
