/** What happens in the recording and when: press to jump there. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { clock, known, t } from "../words/words.js";

const SHOWN = ["initial_pose", "task"];

export function mount(root, api, { station, result }) {
  const box = errorBox();
  const list = h("ol", {});
  let gone = false;
  root.append(h("h2", {}, t("chapters.title")), list, box.element);
  api.titles().then(
    (titles) => gone || draw(titles),
    () => gone || draw(new Map()),
  );

  function draw(titles) {
    const { start } = station.latest.replay;
    const events = result.content.events.filter((event) => SHOWN.includes(event.trial_type));
    const rows = events.map((event) => {
      const words = titles.get(event.task_name) ?? event.task_name ?? known(`event.${event.trial_type}`, event.trial_type);
      const button = h(
        "button",
        { onclick: () => once(button, box, () => station.act("seek", { value: event.onset })) },
        h("span", {}, words),
        h("span", { class: "soft" }, clock(event.onset - start)),
      );
      return h("li", {}, button);
    });
    list.replaceChildren(...(rows.length ? rows : [h("li", { class: "soft" }, t("chapters.none"))]));
  }

  return () => {
    gone = true;
  };
}
