/** What happens in the recording and when: press to jump there, or to repeat it. */
import { h, icon } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { clock, known, t } from "../words/words.js";

/** Chapters of a recording in order of time: { words, start, stop, calibration, excluded }. */
export function chaptersOf(result, titles) {
  const events = result.content.events.filter((event) => event.trial_type === "task" || known(`event.${event.trial_type}`, null));
  const named = (event) => titles.get(event.task_name) ?? event.task_name ?? t(`event.${event.trial_type}`);
  const trial = (event) => events.filter((other) => named(other) === named(event) && other.onset <= event.onset).length;
  const several = (event) => events.filter((other) => named(other) === named(event)).length > 1;
  return events
    .map((event) => ({
      words: several(event) ? t("tapping.trial", { title: named(event), number: trial(event) }) : named(event),
      start: event.onset,
      stop: event.onset + Math.max(event.duration, 0.5),
      calibration: event.trial_type !== "task",
      excluded: event.excluded,
    }))
    .sort((a, b) => a.start - b.start);
}

export function mount(root, api, { station, focus, chapters }) {
  const { start } = station.latest.replay;
  const box = errorBox();
  const rows = chapters.map(row);
  const whole = h("button", { hidden: true, onclick: () => focus.look(null) }, t("chapters.whole"));
  root.append(
    h("h2", {}, t("chapters.title")),
    whole,
    h("ol", {}, rows.length ? rows.map((one) => one.element) : h("li", { class: "soft" }, t("chapters.none"))),
    box.element,
  );

  function row(chapter) {
    const jump = h(
      "button",
      { class: "jump", onclick: () => once(jump, box, () => go(chapter)) },
      h("span", {}, chapter.words, chapter.excluded && h("small", { class: "soft" }, " ", t("chapters.excluded"))),
      h("span", { class: "soft" }, clock(chapter.start - start)),
    );
    const label = t("chapters.repeat.of", { chapter: chapter.words });
    const named = { title: t("chapters.repeat"), "aria-label": label };
    const repeat = h("button", { class: "repeat", "aria-pressed": "false", ...named }, icon("repeat"));
    repeat.addEventListener("click", () => once(repeat, box, () => turn(chapter)));
    return { chapter, jump, repeat, element: h("li", { class: chapter.calibration && "calibration" }, jump, repeat) };
  }

  /** Seen from close by: curves and time line show this chapter alone. */
  function go(chapter) {
    focus.look(chapter);
    return station.act("seek", { value: chapter.start });
  }

  async function turn(chapter) {
    const wanted = focus.chapter === chapter ? null : chapter;
    focus.set(wanted);
    if (!wanted) return;
    await station.act("seek", { value: chapter.start });
    await station.act("play");
  }

  const stops = [
    focus.on(() => (whole.hidden = !focus.near)),
    focus.on((wanted) => rows.forEach(({ chapter, repeat }) => repeat.setAttribute("aria-pressed", String(chapter === wanted)))),
    station.on("pulse", ({ t: now }) =>
      rows.forEach(({ chapter, jump }) => {
        const inside = now >= chapter.start && now < chapter.stop;
        if (inside !== jump.hasAttribute("aria-current")) jump.toggleAttribute("aria-current", inside);
      }),
    ),
  ];
  return () => stops.forEach((stop) => stop());
}
