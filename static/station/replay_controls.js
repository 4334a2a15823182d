/** The time line: play and pause, where it stands, what happens when, how fast; by mouse, touch and keyboard. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once, select } from "../forms.js";
import { around } from "./replay_focus.js";
import { decimal, t } from "../words/words.js";

const SPEEDS = ["0.1", "0.25", "0.5", "1", "2", "4"];
const JUMP = 1; // s that an arrow key goes
const LEAP = 5; // s that a button goes, and an arrow key with Shift

export function mount(root, api, { station, result, focus, chapters }) {
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
  const kindOf = (chapter) => (chapter.calibration ? "calibration" : chapter.excluded ? "excluded" : "");
  const repetitions = Object.values(result.content.repetitions ?? {}).flat();
  const marks = [
    ...chapters.map((chapter) => [chapter, h("span", { class: kindOf(chapter), title: chapter.words })]),
    ...repetitions.map((one) => [one, h("span", { class: one.out ? "repetition excluded" : "repetition" })]),
  ];
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
    h("div", { class: "timeline" }, h("div", { class: "marks", "aria-hidden": "true" }, marks.map(([, mark]) => mark)), slider),
    where,
    pace,
    box.element,
  );

  /** The slider goes as far as the curves are seen. */
  function span() {
    const seen = { start, stop, ...around(focus.near) };
    const share = (seconds) => `${(100 * seconds) / Math.max(seen.stop - seen.start, 1e-6)}%`;
    marks.forEach(([one, mark]) => Object.assign(mark.style, { left: share(one.start - seen.start), width: share(one.stop - one.start) }));
    [slider.min, slider.max] = [seen.start, seen.stop];
    slider.value = at;
  }

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
    const words = t("replay.time", { now: decimal(pulse.t - start, 1), all: decimal(stop - start, 1) });
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
      waiting = null;
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
  const unfocus = focus.on(span);
  span();
  const leave = station.on("pulse", take);
  return () => {
    leave();
    unfocus();
    document.removeEventListener("keydown", pressed);
  };
}
