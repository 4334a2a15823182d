/** The word of the metronome's phase, its lamp, and which movement it is. */
import { h, write } from "../dom.js";
import { countAt, isSingle, makeOnset, placeAt } from "../station/metronome_time.js";
import { counted, t } from "../words/words.js";

const FLASH = 0.15; // s that the lamp is bright

export function mount(root, api, { screen }) {
  const lamp = h("div", { class: "beat" });
  const count = h("p", { class: "count" });
  root.setAttribute("aria-hidden", "true");
  root.append(lamp, count);
  const onset = makeOnset();
  const now = () => performance.now() / 1000;
  let state = null;
  let zero = 0; // s by this page's clock at which the movement began
  let frame = 0;

  function take(next) {
    if (next.stage !== state?.stage) onset.reset();
    state = next;
    const paced = Boolean(state.pace?.cycle.length) && ["watch", "count", "run"].includes(state.stage);
    lamp.hidden = !paced;
    const all = state.pace?.repetitions ?? 0;
    count.hidden = state.stage !== "run" || (paced && isSingle(state.pace)) || !(all || state.done);
    if (!count.hidden && !paced) write(count, all ? t("metronome.count", { done: state.done, all }) : counted("movements", state.done));
    if (paced && state.stage === "run" && state.pace.elapsed !== null) zero = onset.addMessage(now(), state.pace.elapsed);
    if (paced) frame ||= requestAnimationFrame(draw);
  }

  function draw() {
    frame = 0;
    const { pace, stage } = state;
    if (lamp.hidden || !pace?.cycle.length) return;
    const place = stage === "run" ? placeAt(pace, now() - zero) : null;
    const phase = pace.cycle[place?.phase ?? 0];
    write(lamp, phase.say);
    lamp.classList.toggle("bright", place !== null && phase.seconds - place.left < FLASH);
    if (place) {
      const [done, all] = countAt(pace, place);
      write(count, t("metronome.count", { done, all }));
    }
    if (stage === "run") frame = requestAnimationFrame(draw);
  }

  const leave = screen.on("state", take);
  return () => {
    leave();
    cancelAnimationFrame(frame);
  };
}
