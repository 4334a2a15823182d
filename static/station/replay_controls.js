/** The time line: play and pause, where it stands, what happens when, how fast; by mouse, touch and keyboard. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once, select } from "../forms.js";
import { t } from "../words/words.js";

const SPEEDS = ["0.1", "0.25", "0.5", "1", "2", "4"];
const JUMP = 1; // s that an arrow key goes
const LEAP = 5; // s that a button goes, and an arrow key with Shift

export function mount(root, api, { station, result, chapters }) {
  const { start, stop, speed } = station.latest.replay;
  const box = errorBox();
  const play = h("button", { class: "primary large play", title: t("replay.keys"), onclick: toggle });
  const slider = h("input", {
    type: "range",
    min: start,
    max: stop,
    step: 0.02,
    "aria-label": t("replay.where"),
    oninput: () => seek(Number(slider.value)),
  });
  const leap = (by, words, label) => {
    const parts = [h("span", { "aria-hidden": "true" }, words), h("span", { class: "visually-hidden" }, label)];
    return h("button", { class: "leap", onclick: () => seek(at + by) }, parts);
  };
  const leaps = [
    leap(-LEAP, `« ${LEAP} s`, t("replay.back_by", { seconds: LEAP })),
    leap(LEAP, `${LEAP} s »`, t("replay.on_by", { seconds: LEAP })),
  ];
  const share = (moment) => `${(100 * (moment - start)) / Math.max(stop - start, 1e-6)}%`;
  const marks = chapters.map((chapter) => {
    const mark = h("span", { class: chapter.calibration ? "calibration" : chapter.excluded ? "excluded" : "", title: chapter.words });
    Object.assign(mark.style, { left: share(chapter.start), width: share(start + chapter.stop - chapter.start) });
    return mark;
  });
  const repetitions = Object.values(result.content.repetitions ?? {}).flat();
  marks.push(
    ...repetitions.map((one) => {
      const mark = h("span", { class: one.out ? "repetition excluded" : "repetition" });
      Object.assign(mark.style, { left: share(one.start), width: share(start + one.stop - one.start) });
      return mark;
    }),
  );
  const where = h("output", { class: "where" });
  const pace = select(
    SPEEDS.map((value) => [value, t("replay.speed", { value })]),
    String(speed),
    { "aria-label": t("replay.speed.label"), onchange: () => once(pace, box, () => station.act("speed", { value: Number(pace.value) })) },
  );
  let playing = null;
  let at = start;
  let [waiting, busy] = [null, false];
  root.append(
    play,
    ...leaps,
    h("div", { class: "timeline" }, h("div", { class: "marks", "aria-hidden": "true" }, marks), slider),
    where,
    pace,
    box.element,
  );

  const drawPlay = whenChanged(
    (pulse) => pulse.playing,
    (now) => {
      playing = now;
      play.textContent = t(now ? "replay.pause" : "replay.play");
    },
  );

  function toggle() {
    return once(play, box, () => station.act(playing ? "pause" : "play"));
  }

  function take(pulse) {
    drawPlay(pulse);
    at = waiting ?? (busy ? at : pulse.t);
    if (waiting === null && !busy) slider.value = pulse.t;
    const words = t("replay.time", { now: (pulse.t - start).toFixed(1), all: (stop - start).toFixed(1) });
    if (where.textContent !== words) where.textContent = words;
    slider.setAttribute("aria-valuetext", words);
  }

  /** One request at a time; of the places wished for meanwhile only the newest counts. */
  async function seek(moment) {
    waiting = at = Math.min(Math.max(moment, start), stop);
    slider.value = at;
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

  function pressed(event) {
    const typing = event.target.closest("select, textarea, input:not([type=range])");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? LEAP : JUMP;
    const keys = { ArrowLeft: () => seek(at - by), ArrowRight: () => seek(at + by), Home: () => seek(start), End: () => seek(stop) };
    const act = event.key === " " && !event.target.closest("button, a, summary") ? toggle : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  document.addEventListener("keydown", pressed);
  const leave = station.on("pulse", take);
  return () => {
    leave();
    document.removeEventListener("keydown", pressed);
  };
}
