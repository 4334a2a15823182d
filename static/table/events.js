/** What the patient did when: poses and tasks typed in, or a file of events; and when it was measured. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { t } from "../words/words.js";

const POSE = "initial_pose";

export function make(api, findings) {
  const list = h("ol", { class: "mapped" });
  const typed = [{ what: POSE, onset: "", end: "", touched: false }];
  const file = h("input", { type: "file", accept: ".tsv,.txt" });
  const moment = h("input", { type: "datetime-local" });
  let tasks = [];
  let table = "";

  function row(one, k) {
    const numbered = (key) => t(key, { number: k + 1 });
    const kinds = [POSE, "flat_hand"].map((kind) => [kind, t(`table.event.${kind}`)]);
    const what = select([...kinds, ...tasks], one.what, { "aria-label": numbered("table.event.what") });
    const number = { type: "number", min: 0, step: "any", inputmode: "decimal" };
    const times = ["onset", "end"].map((key) =>
      h("input", {
        ...number,
        value: one[key],
        "aria-label": numbered(`table.event.${key}`),
        placeholder: t(`table.event.short.${key}`),
      }),
    );
    const label = { "aria-label": numbered("table.event.remove") };
    const remove = h("button", { type: "button", class: "plain", ...label, onclick: () => drop(k) }, "×");
    const item = h("li", {}, h("div", { class: "what" }, what, times, remove));
    item.addEventListener("change", () => {
      const [onset, end] = times.map((input) => input.value);
      Object.assign(one, { what: what.value, onset, end, touched: true });
    });
    return item;
  }

  const draw = () => list.replaceChildren(...typed.map(row));
  const drop = (k) => {
    typed.splice(k, 1);
    draw();
  };
  const add = h(
    "button",
    {
      type: "button",
      onclick: () => {
        typed.push({ what: tasks[0]?.[0] ?? "flat_hand", onset: "", end: "", touched: true });
        draw();
        list.lastElementChild.querySelector("select").focus();
      },
    },
    t("table.event.add"),
  );

  /** The first rest is offered for the pose until somebody types another. */
  findings.watch(({ rests }) => {
    const [first] = [...rests].sort((a, b) => a[0] - b[0]);
    if (!first || !typed[0] || typed[0].touched) return;
    [typed[0].onset, typed[0].end] = first.map((s) => s.toFixed(2));
    draw();
  });
  file.addEventListener("change", async () => {
    table = (await file.files[0]?.text()) ?? "";
    if (table && typed[0] && !typed[0].touched) drop(0);
  });
  api.titles().then(
    (titles) => {
      tasks = [...titles].map(([name, words]) => [`task:${name}`, words]);
      draw();
    },
    () => null,
  );
  draw();

  return {
    element: h(
      "div",
      {},
      h("p", { class: "soft" }, t("table.events.lead")),
      list,
      add,
      h(
        "div",
        { class: "options" },
        field(t("table.events.file"), file, t("table.events.file.hint")),
        field(t("table.started"), moment, t("table.started.hint")),
      ),
    ),
    value: () => ({
      events: typed.filter(({ onset, end }) => onset !== "" || end !== "").map(eventOf),
      events_tsv: table,
      started: moment.value ? new Date(moment.value).toISOString() : null,
    }),
  };
}

function eventOf({ what, onset, end }) {
  if (onset === "" || end === "" || Number(end) < Number(onset)) throw new Error(t("table.event.times"));
  const [kind, task = ""] = what.split(":");
  return { trial_type: kind, onset: Number(onset), duration: Number(end) - Number(onset), task };
}
