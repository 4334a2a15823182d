/** A button for exactly what can be done now, the one that leads on first and largest. */
import { h, whenChanged } from "../dom.js";
import { errorBox, once } from "../forms.js";
import * as confirming from "./confirming.js";
import { notEnough } from "./free_movement.js";
import { goingOn, leading, spoilt } from "./going_on.js";
import { segmentWords } from "../words/clinical.js";
import { known, t } from "../words/words.js";

const ELSEWHERE = ["choose", "group"]; // the list of tasks has these
const ANEW = ["calibrate", "free", "recalibrate"]; // folded where a task is chosen, whose list is below
const ASKED = ["skip", "unable", "without", "finish", "enough"]; // actions that may ask something back first

const SCORED = ["accept", "again", "onward", "close"]; // the clinician's own score goes with these

export function mount(root, api, { station, given }) {
  const box = errorBox();
  const actions = h("div", { class: "buttons-tall" });
  root.append(actions, box.element);
  let owed = true; // the keyboard waits for the next button that goes on: at the beginning, and where none did after a step
  let asking = null; // the state in which a question stands; it stays while that state lasts
  let closeQuestion = () => {};
  const draw = whenChanged(
    ({ wizard, glove, self_calibration, calibration, stiff_joints }) => [
      wizard.state,
      wizard.actions,
      next(wizard),
      glove.problem,
      wizard.remaining === null,
      wizard.pace?.trial,
      spoilt(wizard),
      wizard.proposal,
      wizard.mend,
      wizard.passive,
      self_calibration?.enough,
      calibration?.source,
      stiff_joints?.asked || stiff_joints?.pending,
    ],
    buttons,
  );

  function buttons([state, allowed]) {
    const { wizard, calibration } = station.latest;
    if (asking === state) return;
    const held = actions.contains(document.activeElement) || (owed && document.activeElement === document.body);
    closeQuestion();
    box.clear();
    const primary = leading(station.latest);
    const folds = state === "tasks" && calibration?.source !== "none";
    const folded = allowed.filter((act) => folds && ANEW.includes(act) && act !== primary);
    const elsewhere = [...ELSEWHERE, ...folded];
    const shown = allowed.filter((act) => !elsewhere.includes(act)).sort((a, b) => Number(b === primary) - Number(a === primary));
    const one = (act) =>
      button(act, label(station.latest, act), act === primary || (state === "tasks" && act === "finish" && !next(wizard)), () => wish(act));
    const drawn = shown.map(one);
    if (state === "tasks" && allowed.includes("choose") && next(wizard))
      drawn.unshift(
        button("choose", nextWords(next(wizard)), true, () => station.act("choose", { task: next(wizard).name })),
      );
    if (folded.length) drawn.push(h("details", {}, h("summary", {}, t("act.anew")), h("div", { class: "buttons-tall" }, folded.map(one))));
    if (state === "connect" && !allowed.includes("continue") && !station.latest.glove.problem)
      drawn.push(h("p", { class: "soft" }, t("wizard.waiting")));
    actions.replaceChildren(...drawn);
    const onward = actions.querySelector(`[data-act="${goingOn(station.latest, primary)}"]`);
    if (held) onward?.focus();
    owed = held && !onward;
  }

  function button(act, text, isPrimary, work) {
    const classes = `large ${isPrimary ? "primary" : ""}`;
    const button = h("button", { class: classes, "data-act": act, onclick: () => once(button, box, work) }, text);
    return button;
  }

  /** Do it, after asking back where that is due. */
  async function wish(act) {
    const { wizard, self_calibration: moved } = station.latest;
    const plain = { finish: !open(wizard).length, enough: moved?.enough }; // nothing is left to ask
    if (!ASKED.includes(act) || plain[act]) return station.act(act, scored(wizard, act));
    const asked = h("div", {});
    const about = { act, left: open(wizard), lacking: notEnough(moved?.meter ?? []), cancel };
    const leave = confirming.mount(asked, api, { ...about, send: (reason) => station.act(act, { reason }) });
    actions.replaceChildren(asked);
    asked.querySelector("input, [data-back]").focus(); // never what gives something up
    // all of it stays in view, whatever comes above it later, or into it: on a tablet the way back would lie below the edge
    const above = new ResizeObserver(() => asked.scrollIntoView({ block: "nearest" }));
    for (const part of [asked, ...root.parentElement.children]) above.observe(part);
    asking = wizard.state;
    closeQuestion = () => {
      above.disconnect();
      leave();
      asking = null;
      closeQuestion = () => {};
    };
    return null;
  }

  function scored(wizard, act) {
    return wizard.score && SCORED.includes(act) && given.score !== null ? { value: given.score } : {};
  }

  function cancel() {
    const { wizard } = station.latest;
    closeQuestion();
    buttons([wizard.state, wizard.actions]);
    const onward = goingOn(station.latest, leading(station.latest));
    (actions.querySelector(`[data-act="${onward}"]`) ?? actions.querySelector("button"))?.focus();
  }

  return station.on("full", draw);
}

function label({ wizard, self_calibration }, act) {
  const { state, remaining, actions } = wizard;
  if (act === "enough" && !self_calibration?.enough) return t("act.free_run.enough.early");
  if (state === "check") return t(`act.check.${act}`);
  if (act === "next" && (state === "step_ready" || spoilt(wizard))) return t("act.next_step.skip");
  if (act === "next") return t("act.next_step");
  if (act === "correct") return mendWords(wizard.mend);
  if (act === "exchange") return exchangeWords(wizard.check.exchange);
  if (act === "assist") return t(wizard.passive ? "act.assist.back" : "act.assist");
  if (act === "onward") return t("act.onward", { task: wizard.following.title });
  if (act === "accept" && ["again", "onward"].some((other) => actions.includes(other))) return t("act.accept.leave");
  if (state === "task_run" && act === "stop" && remaining === null) return t("act.done"); // nothing else ends it
  return known(`act.${state}.${act}`, null) ?? t(`act.${act}`);
}

function nextWords({ title, trials, accepted }) {
  return trials > 1 && accepted ? t("act.next.trial", { task: title, trial: accepted + 1, trials }) : t("act.next", { task: title });
}

function mendWords({ kind, sensors }) {
  const [one, other] = sensors.map(segmentWords);
  const list = sensors.length > 2 ? t("mend.every_sensor") : one;
  return t(`act.correct.${kind}`, kind === "exchange" ? { one, other } : { sensors: list });
}

function exchangeWords([one, ...more]) {
  return more.length > 1 ? t("act.exchange.all") : t("act.exchange", { one: t(`part.${one.finger}`), other: t(`part.${one.strip}`) });
}

/** Tasks that are still to be done. */
export const open = (wizard) => wizard.tasks.filter((task) => !task.outcome);
const next = (wizard) => open(wizard)[0] ?? null;
