/** Proposes self-calibration where the recording holds movement enough; once it is done, what there was before and after. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { several } from "../words/joined.js";
import { t } from "../words/words.js";

const METHOD = "map";

export function mount(root, api, { session, result, go, treats }) {
  const box = errorBox();
  const recording = session.recordings.find((one) => one.id === result.recording);
  const [after, before] = [METHOD, null].map((method) => standing(recording, method));
  let gone = false;
  root.hidden = true;
  if (after?.state === "done" && before) draw();
  else if (!after && result.self_calibration_gains.length && treats) propose();

  function propose() {
    const send = h("button", { onclick: () => once(send, box, compute) }, t("gain.compute"));
    const lead = h("p", {}, t("gain.lead", { fingers: several(result.self_calibration_gains) }));
    root.append(h("h2", {}, t("gain.title")), lead, h("p", { class: "soft" }, t("gain.note")), h("p", {}, send), box.element);
    root.hidden = false;
  }

  async function compute() {
    const made = await api.post(`/api/sessions/${session.id}/results`, { method: METHOD, options: {} });
    go(`/sessions/${session.id}?result=${made.result}`);
  }

  async function draw() {
    try {
      const [first, then] = await Promise.all([before, after].map(({ id }) => api.get(`/api/results/${id}?lean=true`)));
      if (gone) return;
      const rows = pairs(tiles(first.readings), tiles(then.readings));
      const reached = rows.length ? [] : pairs(flexions(first.readings), flexions(then.readings));
      const lengths = then.self_calibration?.changes ?? [];
      const tables = [table("gain.figure", rows, before), table("ranges.flexion", reached, before), table("gain.length", lengths, before)];
      root.append(h("h2", {}, t("gain.both")), ...tables.filter(Boolean));
      root.hidden = !tables.some(Boolean);
    } catch (error) {
      gone || ((root.hidden = false), box.show(error), root.append(box.element));
    }
  }

  return () => {
    gone = true;
  };
}

/** The result that counts now by self-calibration, or by another method. */
function standing(recording, method) {
  return recording?.results.find((one) => one.current && (method ? one.method === method : one.method !== METHOD && one.state === "done"));
}

/** Rows [label, before, after] of what both have, of [key, label, value]. */
function pairs(before, after) {
  const known = new Map(before.map(([key, , value]) => [key, value]));
  return after.filter(([key, , value]) => value && known.get(key)).map(([key, label, value]) => [label, known.get(key), value]);
}

function tiles({ headlines }) {
  return headlines.flatMap((task, k) => task.tiles.map(({ label, value }) => [`${k} ${label}`, `${task.title}: ${label}`, value]));
}

function flexions({ ranges }) {
  const named = ({ group, joint, flexion }, k) => [`${k} ${group} ${joint}`, `${group} ${joint}`.trim(), flexion];
  return ranges.flatMap(({ rows }, k) => rows.map((row) => named(row, k)));
}

function table(what, rows, before) {
  if (!rows.length) return null;
  const heads = [t(what), t("gain.before", { method: before.method }), t("gain.after")];
  const head = h(
    "tr",
    {},
    heads.map((words) => h("th", { scope: "col" }, words)),
  );
  const body = rows.map(([first, ...cells]) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, first),
      cells.map((words) => h("td", {}, words.replaceAll(" ± ", "\u00a0±\u00a0"))),
    ),
  );
  return h("table", { class: "compact" }, h("thead", {}, head), h("tbody", {}, body));
}
