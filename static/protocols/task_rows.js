/** The tasks of a protocol in their order, each with trials, seconds or rounds, and words of its own. */
import { h, icon } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";

const LONGEST = 300; // characters of a task's words

/** `planned` as the protocol has them, `tasks` all that there are; `read` gives them back as they stand. */
export function taskRows(planned, tasks) {
  const known = new Map(tasks.map((task) => [task.name, task]));
  const list = h("ol", { class: "plan-tasks" });
  const names = tasks.map((task) => [task.name, task.title]);
  const more = select([["", t("protocols.add")], ...names], "", { "aria-label": t("protocols.add"), onchange: add });
  list.append(...planned.map(row));

  function row(one) {
    const task = known.get(one.task);
    const paced = Boolean(task?.cycle.length);
    const number = (name, usual, most) =>
      h("input", { type: "number", name, min: 1, max: most, value: one[name] ?? "", placeholder: usual ?? "" });
    const trials = field(t("protocols.trials"), number("trials", task?.trials, 100));
    const seconds = task?.duration && field(t("protocols.seconds"), number("seconds", task.duration, 600));
    const rounds = paced && field(t("protocols.rounds"), number("repetitions", task.repetitions, 100));
    const words = (name) => h("input", { name, maxlength: LONGEST, value: one[name] ?? "", placeholder: task?.[name] ?? "" });
    const item = h("li", { "data-task": one.task });
    const title = task?.title ?? one.task;
    const button = (word, act, sign) =>
      h("button", { type: "button", class: "plain", "aria-label": t(word, { task: title }), onclick: act }, sign);
    const up = button("protocols.up", () => move(-1), icon("chevron-down"));
    up.classList.add("turned");
    const down = button("protocols.down", () => move(1), icon("chevron-down"));
    const remove = button("protocols.drop", drop, icon("x"));
    item.append(
      h("div", { class: "plan-task" }, h("strong", {}, title), h("div", { class: "buttons" }, up, down, remove)),
      h("div", { class: "plan-numbers" }, [trials, seconds, rounds].filter(Boolean)),
      h(
        "details",
        { open: Boolean(one.title || one.instruction) },
        h("summary", {}, t("protocols.words")),
        field(t("protocols.words.title"), words("title")),
        field(t("protocols.words.instruction"), words("instruction")),
      ),
    );

    function move(by) {
      const [before, after] = [item.previousElementSibling, item.nextElementSibling];
      if (by < 0) before?.before(item);
      else after?.after(item);
      (by < 0 ? up : down).focus();
    }

    function drop() {
      item.remove();
      more.focus();
    }
    return item;
  }

  function add() {
    if (more.value) list.append(row({ task: more.value }));
    more.value = "";
  }

  function read() {
    return [...list.children].map((item) => {
      const inputs = [...item.querySelectorAll("input")].filter((input) => input.value.trim());
      const values = inputs.map((input) => [input.name, input.type === "number" ? Number(input.value) : input.value.trim()]);
      return { task: item.dataset.task, ...Object.fromEntries(values) };
    });
  }

  return { element: h("div", {}, h("h3", {}, t("protocols.tasks")), list, more), read };
}
