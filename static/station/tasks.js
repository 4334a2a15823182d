/** The tasks with what became of them; while tasks are chosen, each is a button. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { t } from "../words/words.js";

const SIGN = { accepted: "✓", skipped: "–" };

export function mount(root, api, { station }) {
  const box = errorBox();
  const list = h("ol", {});
  root.append(h("h3", {}, t("tasks.title")), list, box.element);
  const draw = whenChanged(
    ({ wizard }) => [wizard.tasks, wizard.task, wizard.state, wizard.actions.includes("choose")],
    ([tasks, current, state, choosing]) => {
      root.hidden = state === "connect" || state === "finished";
      list.replaceChildren(...tasks.map((task) => line(task, choosing, state.startsWith("task_") && task.name === current, state)));
    },
  );

  function line(task, choosing, current) {
    const outcome = h(
      "span",
      { class: `badge ${task.outcome === "accepted" ? "good" : task.outcome ? "warn" : ""}` },
      task.outcome ? `${SIGN[task.outcome] ?? ""} ${t(`outcome.${task.outcome}`)}` : current ? t("outcome.now") : t("outcome.open"),
    );
    const words = [h("span", {}, task.title), outcome];
    const choose = () => once(button, box, () => station.act("choose", { task: task.name }));
    const button = choosing ? h("button", { onclick: choose, "data-task": task.name }, words) : h("div", {}, words);
    return h("li", { "aria-current": current && "true" }, button);
  }

  return station.on("full", draw);
}
