/** Which action leads on in a state, and which button the keyboard may hold after a step: the one that goes on with what is being done.
 * One that gives something up or changes how is measured never has the focus by itself: Enter, pressed once too often, destroys nothing. */

const PRIMARY = {
  connect: "continue",
  checked: "continue",
  pose_ready: "start",
  pose_review: "accept",
  task_ready: "start",
  task_review: "accept",
  step_ready: "start",
  free_ready: "start",
  free_review: "use",
  tasks: "choose",
};
const ONWARD = ["continue", "start", "accept", "choose", "next", "resume", "use", "again", "onward", "enough"];

/** `primary` is the action that leads on; gives it where it goes on, else null: then no button has the focus until one does. */
export function goingOn({ wizard }, primary) {
  const { state, actions, remaining } = wizard;
  if (state === "task_run") return remaining === null && actions.includes("stop") ? "stop" : null; // nothing else ends it
  if (state === "tasks") return wizard.tasks.some((task) => !task.outcome) ? "choose" : "finish";
  if (state === "task_paused") return actions.includes("resume") ? "resume" : null; // "start" gives the trial up
  return ONWARD.includes(primary) && actions.includes(primary) ? primary : null;
}

/** The action that leads on. */
export function leading({ wizard, self_calibration, stiff_joints }) {
  const can = (act) => wizard.actions.includes(act);
  if (wizard.state === "pose_review" && (stiff_joints?.asked.length || stiff_joints?.pending) && !can("exchange")) return "redo";
  if (wizard.proposal) return wizard.proposal;
  if (wizard.state === "checked") return can("exchange") ? "exchange" : faultless(wizard.check) ? "continue" : "check";
  if (can("again")) return "again";
  if (can("onward")) return "onward";
  if (wizard.state === "free_run") return self_calibration?.enough ? "enough" : null;
  if (wizard.state === "task_paused") return can("resume") ? "resume" : "start";
  if (wizard.state !== "step_review") return PRIMARY[wizard.state];
  return spoilt(wizard) ? "redo" : can("next") ? "next" : "use";
}

export const spoilt = ({ task, calibration_steps }) => calibration_steps.find((step) => step.name === task)?.outcome === "spoilt";

const faultless = ({ moved }) => Object.entries(moved).every(([finger, strip]) => finger === strip);
