/** Which chapter of a replay is looked at closely, and whether it is repeated; parts of the page follow it. */
import { errorBox } from "../forms.js";

const MARGIN = 0.5; // s seen before and after a chapter

/** What is seen of a recording around a chapter, { start, stop } in s; null where there is none. */
export function around(chapter) {
  return chapter && { start: chapter.start - MARGIN, stop: chapter.stop + MARGIN };
}

export function makeFocus(station) {
  const box = errorBox();
  const listeners = new Set();
  let chapter = null; // that is repeated
  let near = null; // that is looked at
  let turning = false;
  let played = false; // when the pulse before came

  const stop = station.on("pulse", async (pulse) => {
    // a page that hears late of a chapter's end may find that the recording has ended, and with it the replay
    const ended = played && pulse.t >= station.latest.replay.stop;
    played = pulse.playing;
    if (!chapter || !(pulse.playing || ended) || turning || (pulse.t < chapter.stop && pulse.t >= chapter.start - 0.5)) return;
    turning = true;
    try {
      await station.act("seek", { value: chapter.start });
      if (ended) await station.act("play");
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
    /** The chapter that curves and time line show; null shows the whole recording. */
    get near() {
      return chapter ?? near;
    },
    /** Look at { start, stop } closely without repeating it. */
    look(wanted) {
      chapter = null;
      near = wanted;
      listeners.forEach((listener) => listener(chapter));
    },
    /** Repeat { start, stop } from now on; null goes through the recording as it is. */
    set(wanted) {
      chapter = near = wanted;
      listeners.forEach((listener) => listener(chapter));
    },
    on(listener) {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    leave: stop,
  };
}
