/** Leave out a trial, a repetition or another stretch of it, or move its ends: seen on its curve, always with a reason. */
import { h } from "../dom.js";
import { choices, errorBox, field, onSubmit } from "../forms.js";
import { LINES, SETS, chooseSet, curvesAddress } from "../plots/curve_sets.js";
import { legend } from "../plots/legend.js";
import { colour, makePlot } from "../plots/plot.js";
import { curveWords, distinctWords, valueWords } from "../words/clinical.js";
import { decimal, t } from "../words/words.js";
import { number, repetition } from "./repetitions.js";

const REASONS = ["helped", "wrong", "interrupted", "slipped", "pain"];
const STEP = 0.1; // s

export function mount(root, api, { result, trial, send }) {
  const box = errorBox();
  const [curve, names] = [h("div", { class: "tall" }), h("div", {})];
  const set = chooseSet(trial.tapping, draw);
  const kinds = ["exclude", "leave_out", "move"].filter((kind) => !(kind === "leave_out" && trial.tapping));
  const what = choices(
    t("correct.what"),
    "correction",
    kinds.map((kind, k) => ({ value: kind, label: t(`correct.${kind}`), note: t(`correct.${kind}.note`), checked: k === 0 })),
    "several",
  );
  const ends = ["from", "to"].map((end) => slider(end, trial, drawEnds));
  const stretch = h(
    "div",
    { class: "pair" },
    ends.map((end) => end.element),
  );
  const each = trial.tapping ? [] : (result.content.repetitions?.[trial.event] ?? []);
  const repetitions = each.map((one, k) => repetition(one, k + 1, () => choose(one)));
  const heading = t("correct.repetitions");
  const reason = h("input", { name: "reason", maxlength: 1000, autocomplete: "off" });
  const offered = new Map(REASONS.map((code) => [t(`correct.reason.${code}`), code]));
  const quick = [...offered.keys()].map((words) => h("button", { type: "button", onclick: () => (reason.value = words) }, words));
  const form = h(
    "form",
    { class: "correcting", novalidate: true },
    h("div", { class: "curves-head" }, set, names),
    curve,
    each.length > 0 && h("div", { class: "repetitions", role: "group", "aria-label": heading }, h("span", {}, heading), repetitions),
    what,
    stretch,
    field(t("correct.why"), reason, t("correct.why.hint")),
    h("div", { class: "buttons" }, quick),
    h("div", { class: "buttons" }, h("button", { class: "primary", type: "submit" }, t("correct.send"))),
    box.element,
  );
  let plot = null;
  let asked = 0;
  root.replaceChildren(form);
  what.addEventListener("change", drawEnds);
  const kind = () => form.elements.correction.value;
  const chosen = () => ends.map((end) => trial.onset + Number(end.input.value));

  /** A repetition's ends, to be left out as they are or moved. */
  function choose(one) {
    form.elements.correction.value = "leave_out";
    [one.start, one.stop].forEach((moment, k) => ends[k].go(moment - trial.onset));
    drawEnds();
  }

  function drawEnds() {
    stretch.hidden = kind() === "exclude";
    ends.forEach((end) => end.tell());
    plot?.plot?.redraw();
  }

  /** What will not count is veiled. */
  function veil(drawn) {
    const { ctx, bbox } = drawn;
    const at = (moment) => Math.min(Math.max(drawn.valToPos(moment - trial.onset, "x", true), bbox.left), bbox.left + bbox.width);
    const [from, to] = chosen().map(at);
    const whole = [bbox.left, bbox.left + bbox.width];
    const parts = { exclude: [whole], leave_out: [[from, to]], move: [[whole[0], from], [to, whole[1]]] }[kind()]; // prettier-ignore
    ctx.save();
    ctx.globalAlpha = 0.78;
    ctx.fillStyle = colour("--surface-sunk");
    parts.forEach(([left, right]) => ctx.fillRect(left, bbox.top, Math.max(0, right - left), bbox.height));
    ctx.restore();
    number(drawn, each, at);
  }

  async function draw() {
    const mine = (asked += 1);
    const shown = SETS[set.value];
    try {
      const span = { start: trial.onset, stop: trial.onset + trial.duration };
      const payload = await api.get(curvesAddress(result.id, shown, span));
      if (mine !== asked) return;
      plot?.destroy();
      names.replaceChildren(shown.length > 1 ? legend(shown.map((one) => distinctWords(one, shown))) : "");
      plot = makePlot(curve, {
        label: t("correct.curve", { what: shown.map(curveWords).join(", ") }),
        lines: LINES.slice(0, shown.length),
        words: (value) => valueWords(shown[0], value),
        xWords: (seconds) => t("correct.seconds", { seconds }),
        axis: 96,
        drawn: veil,
      });
      plot.set([payload.t.map((moment) => moment - trial.onset), ...shown.map((one) => payload.curves[one])]);
    } catch (error) {
      if (mine === asked) box.show(error);
    }
  }

  onSubmit(form, box, async () => {
    const words = reason.value.trim();
    if (!words) throw new Error(t("correct.missing"));
    const why = offered.has(words) ? { reason_code: offered.get(words) } : { reason: words };
    const [onset, end] = chosen();
    await send({ event: trial.event, kind: kind(), ...why, onset, end });
  });
  drawEnds();
  draw();
  return () => {
    asked += 1;
    plot?.destroy();
  };
}

function slider(end, trial, changed) {
  const input = h("input", { type: "range", min: 0, max: trial.duration.toFixed(3), step: STEP, oninput: changed });
  input.value = end === "from" ? 0 : trial.duration;
  const status = h("output", { class: "where" });
  const element = h("div", {}, field(t(`correct.${end}`), input), status);
  const words = () => t("correct.seconds", { seconds: decimal(input.value, 1) });
  return {
    input,
    element,
    go(seconds) {
      input.value = seconds;
    },
    tell() {
      status.textContent = words();
      input.setAttribute("aria-valuetext", words());
    },
  };
}
