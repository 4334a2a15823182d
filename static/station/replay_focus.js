/** Which chapter of a replay is looked at closely and repeated, if any; parts of the page hear of it. */
import { errorBox } from "../forms.js";

export function makeFocus(station) {
  const box = errorBox();
  const listeners = new Set();
  let chapter = null;
  let turning = false;

  const stop = station.on("pulse", async (pulse) => {
    if (!chapter || !pulse.playing || turning || (pulse.t < chapter.stop && pulse.t >= chapter.start - 0.5)) return;
    turning = true;
    try {
      await station.act("seek", { value: chapter.start });
      box.clear();
    } catch (error) {
      box.show(error);
    } finally {
      turning = false;
    }
  });

  return {
    element: box.element,
    get chapter() {
      return chapter;
    },
    /** Repeat { start, stop } from now on; null goes through the recording as it is. */
    set(wanted) {
      chapter = wanted;
      listeners.forEach((listener) => listener(chapter));
    },
    on(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    leave: stop,
  };
}
