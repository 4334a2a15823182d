/** The goal of a figure: the range that it is to reach, in words, and a form that sets it. */
import { h } from "../dom.js";
import { errorBox, field, once, onSubmit } from "../forms.js";
import { labelled } from "../words/joined.js";
import { t } from "../words/words.js";
import { labelWords, valueWords } from "./figure_words.js";

export function drawGoal(root, series, hand, { api, patient, reload }) {
  const box = errorBox();
  const goal = series.goals[hand];
  const number = (value) => h("input", { type: "number", step: "any", required: true, value: value ?? "" });
  const [low, high] = [number(goal?.low), number(goal?.high)];
  const read = h("p", { class: "hint", role: "status" });
  const say = () => (read.textContent = low.value && high.value ? words(series, { low: +low.value, high: +high.value }) : "");
  const remove = h("button", { type: "button", class: "plain" }, t("goal.remove"));
  remove.addEventListener("click", () => once(remove, box, () => api.remove(`/api/goals/${goal.id}`).then(reload)));
  const form = h(
    "form",
    { class: "goal-form" },
    field(t("goal.from"), low, series.joint && series.end === "smallest" ? t("goal.extension") : ""),
    field(t("goal.to"), high),
    read,
    h("div", { class: "buttons" }, h("button", { type: "submit" }, t("goal.save")), goal && remove),
    box.element,
  );
  form.addEventListener("input", say);
  say();
  onSubmit(form, box, async () => {
    const { measure, task, name, unit } = series;
    const range = { low: +low.value, high: +high.value };
    await api.put(`/api/patients/${patient}/goals`, { hand, measure, task, name, unit, ...range });
    await reload();
  });
  const title = goal ? t("goal.change") : t("goal.set");
  root.append(h("details", { class: "goal" }, h("summary", { "aria-label": labelled(title, labelWords(series)) }, title), form));
}

/** "Goal: 70° to 90°". */
export const words = (series, goal) => t("goal.words", { low: valueWords(series, goal.low), high: valueWords(series, goal.high) });
