/** This result beside the hand landmarks of a camera: the file is compared and not kept. */
import { h } from "../dom.js";
import { errorBox, field, onSubmit, select } from "../forms.js";
import { progressBar } from "../progress_bar.js";
import { curveWords } from "../words/clinical.js";
import { counted, decimal, t } from "../words/words.js";
import * as compared from "./compared.js";
import { trialsOf } from "./trials.js";

const COLUMNS = ["drms", "drms_minus_offset", "rom_a", "rom_b"];

export function mount(root, api, { session, result }) {
  const box = errorBox();
  const bar = progressBar(t("upload.progress"));
  const input = h("input", { type: "file", accept: ".json,.csv", name: "landmarks", required: true });
  const send = h("button", { type: "submit" }, t("camera.compare"));
  const form = h(
    "form",
    { novalidate: true },
    field(t("camera.file"), input, t("camera.file.hint")),
    bar.element,
    box.element,
    h("p", {}, send),
  );
  const place = h("div", {});
  const file = session.recordings.find((recording) => recording.id === result.recording);
  let leave = () => {};
  let gone = false;
  bar.element.hidden = true;

  onSubmit(form, box, async () => {
    if (!input.files[0]) throw new Error(t("camera.choose"));
    const data = new FormData();
    data.append("file", input.files[0]);
    bar.element.hidden = false;
    leave();
    place.replaceChildren();
    try {
      const [payload, titles] = await Promise.all([
        api.upload(`/api/results/${result.id}/landmark-comparisons`, data, (share) =>
          bar.set(share, t(share < 1 ? "upload.sending" : "camera.comparing")),
        ),
        api.titles().catch(() => new Map()),
      ]);
      if (!gone) leave = draw(place, api, payload, trialsOf(file, titles));
    } finally {
      bar.element.hidden = true;
    }
  });

  root.append(
    h(
      "details",
      {},
      h("summary", {}, h("h2", {}, t("camera.title"))),
      h("p", { class: "soft" }, t("camera.lead")),
      h("p", { class: "warning" }, t("camera.limits")),
      form,
      place,
    ),
  );
  return () => {
    gone = true;
    leave();
  };
}

/** @param {import("../types/api.d.ts").LandmarkAnswer} payload */
function draw(place, api, payload, trials) {
  const names = payload.stretches.map(({ event }) => trials.find((trial) => trial.event === event)?.name ?? t("compare.whole"));
  const stretch = select(
    names.map((name, k) => [String(k), name]),
    "0",
    { "aria-label": t("compare.trial"), onchange: show },
  );
  const angle = select(
    payload.curves.map(({ what }) => [what, curveWords(what)]),
    payload.curves.find(({ what }) => what === "index_pip_flexion")?.what ?? payload.curves[0].what,
    { "aria-label": t("curves.choose"), onchange: show },
  );
  const rows = h("tbody", {});
  const plot = h("div", {});
  let leave = () => {};
  const heads = ["angle", "offset", ...COLUMNS].map((name) => h("th", { scope: "col" }, t(`camera.${name}`)));
  const table = h("table", { class: "ranges" }, h("thead", {}, h("tr", {}, heads)), rows);
  place.replaceChildren(
    h("p", { role: "status" }, counted("camera.seen", payload.frames, { name: payload.name, share: Math.round(100 * payload.seen) })),
    ...clockWords(payload.lag).map((words) => h("p", { class: "soft" }, words)),
    h("div", { class: "course-head" }, stretch, angle),
    plot,
    h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("camera.table") }, table),
    h("p", { class: "hint" }, t("camera.range")),
  );
  show();

  function show() {
    const part = payload.stretches[Number(stretch.value)];
    const curve = payload.curves.find(({ what }) => what === angle.value);
    const agreement = part.angles.find(({ what }) => what === angle.value);
    rows.replaceChildren(...part.angles.map(row));
    leave();
    leave = () => {};
    if (!curve || !agreement) return void plot.replaceChildren(h("p", { class: "soft" }, t("camera.unseen")));
    const cut = { agreement, ...within(curve, part) };
    leave = compared.mount(plot, api, { payload: cut, what: curve.what, names: [t("compare.this"), t("camera.name")] });
  }

  return () => leave();
}

function row(agreement) {
  const cell = (name) => h("td", { class: "number" }, `${decimal(agreement[name], 1)}°`);
  const offset = h("td", {}, compared.differenceWords(Number(agreement.offset.toFixed(1)), "°"));
  return h("tr", {}, h("th", { scope: "row" }, curveWords(agreement.what)), offset, COLUMNS.map(cell));
}

/** The samples of a curve between a stretch's two ends. */
function within({ t: times, a, b, difference }, { onset, end }) {
  const inside = (_, k) => times[k] >= onset && times[k] <= end;
  return { t: times.filter(inside), a: a.filter(inside), b: b.filter(inside), difference: difference.filter(inside) };
}

/** @param {import("../types/api.d.ts").ClockLag} lag */
function clockWords(lag) {
  const fit = { seconds: decimal(Math.abs(lag.seconds), 3), correlation: decimal(lag.correlation, 2), overlap: decimal(lag.overlap, 0) };
  return [
    t(lag.seconds < 0 ? "camera.ahead" : "camera.behind", fit),
    lag.ppm !== null && t(lag.ppm > 0 ? "camera.fast" : "camera.slow", { ppm: decimal(Math.abs(lag.ppm), 0) }),
    lag.rival !== null && t("camera.rival", { seconds: decimal(lag.rival, 2) }),
  ].filter(Boolean);
}
