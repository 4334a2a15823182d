/** The tasks of a group with what became of them; while tasks are chosen, each is a button, and another group can be taken. */
import { h, icon, whenChanged } from "../dom.js";
import { errorBox, field, once, select } from "../forms.js";
import { known, t } from "../words/words.js";

const SIGN = { accepted: "check", good: "check", used: "check", skipped: "minus", unable: "x", spoilt: "triangle-alert" };
const GOOD = ["accepted", "good", "used"];

export function mount(root, api, { station }) {
  const box = errorBox();
  const list = h("ol", {});
  const choice = h("div", {});
  const heading = h("h3", {});
  const faults = h("div", {});
  root.append(heading, choice, list, box.element, faults);
  const drawFaults = whenChanged(
    ({ wizard, protocol_faults }) => [wizard.state === "tasks", protocol_faults],
    ([choosing, problems]) => {
      const line = ({ reason }) => h("p", { class: "warning small" }, t("tasks.fault", { text: reason }));
      faults.replaceChildren(...(choosing ? problems : []).map(line));
    },
  );
  const drawGroups = whenChanged(
    ({ wizard }) => [wizard.groups, wizard.group, wizard.actions.includes("group") && wizard.groups.length > 1],
    ([groups, now, choosing]) => {
      const held = choice.contains(document.activeElement);
      choice.hidden = !choosing;
      choice.replaceChildren(groupChoice(groups, now));
      if (held && choosing) choice.querySelector("select").focus();
    },
  );
  const draw = whenChanged(
    ({ wizard }) => [
      wizard.calibration_steps.length ? wizard.calibration_steps : wizard.tasks,
      wizard.task,
      wizard.state,
      wizard.actions.includes("choose"),
    ],
    ([tasks, current, state, choosing]) => {
      root.hidden = /^(connect|check|finished|pose_)/.test(state);
      heading.textContent = t(state.startsWith("step_") ? "tasks.steps" : "tasks.title");
      list.replaceChildren(...tasks.map((task) => line(task, choosing, /^(task|step)_|countdown$/.test(state) && task.name === current)));
    },
  );

  function groupChoice(groups, now) {
    const rows = groups.map((group) => [group.name, groupWords(group)]);
    const control = select(rows, now, { onchange: () => once(control, box, () => station.act("group", { group: control.value })) });
    return field(t("tasks.group"), control);
  }

  function line(task, choosing, current) {
    const outcome = h(
      "span",
      { class: `badge ${GOOD.includes(task.outcome) ? "good" : task.outcome ? "warn" : ""}` },
      ...stands(task, current),
    );
    const words = [h("span", {}, task.title), outcome];
    const choose = () => once(button, box, () => station.act("choose", { task: task.name }));
    const button = choosing ? h("button", { onclick: choose, "data-task": task.name }, words) : h("div", {}, words);
    return h("li", { "aria-current": current && "true" }, button);
  }

  const leave = [station.on("full", drawGroups), station.on("full", drawFaults), station.on("full", draw)];
  return () => leave.forEach((stop) => stop());
}

function stands({ outcome, trials, accepted }, current) {
  if (outcome) return [SIGN[outcome] && icon(SIGN[outcome]), t(`outcome.${outcome}`)].filter(Boolean);
  if (trials > 1 && accepted) return [t("outcome.trials", { accepted, trials })];
  return [current ? t("outcome.now") : t("outcome.open")];
}

function groupWords({ name, title, planned, tasks, done }) {
  const words = { title: planned ? title : known(`group.${name}`, title), tasks, done };
  return done ? t("tasks.group.done", words) : t("tasks.group.open", words);
}
