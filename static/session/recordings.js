/** Where the numbers come from: the recording, its checksum, device, rates and losses. */
import { h } from "../dom.js";
import { deviceWords, stripWords } from "../words/clinical.js";
import { dayAndTime, t, whole } from "../words/words.js";

export function mount(root, api, { session, result }) {
  const closed = session.recordings.filter((recording) => recording.sha256);
  root.append(
    h(
      "details",
      {},
      h("summary", {}, h("h2", {}, t("recording.title"))),
      closed.map((recording) => one(recording, result)),
    ),
  );
  return () => {};
}

/** @param {import("../types/api.d.ts").RecordingRow} recording */
function one(recording, result) {
  const { summary } = recording;
  const source = summary.source ?? {};
  const facts = [
    ["recording.name", recording.name],
    ["recording.added", dayAndTime(recording.added)],
    [
      "recording.device",
      [
        source.device && deviceWords(source.device),
        source.device_id,
        source.firmware && t("recording.firmware", { version: source.firmware }),
      ]
        .filter(Boolean)
        .join(", "),
    ],
    ["recording.format", t("recording.size", { format: recording.format, bytes: whole(recording.bytes) })],
    ["recording.gaps", summary.samples_with_gaps ? whole(summary.samples_with_gaps) : t("recording.none")],
    ["recording.checksum", h("code", {}, recording.sha256)],
    ["recording.method", result && t("recording.method.value", { method: result.method, version: result.version })],
  ];
  const rows = facts.filter(([, value]) => value).map(([word, value]) => [h("dt", {}, t(word)), h("dd", {}, value)]);
  return h(
    "div",
    {},
    h("dl", { class: "facts" }, rows),
    streams(summary),
    h(
      "p",
      { class: "clinicians" },
      h("a", { class: "button", href: `/api/recordings/${recording.id}/file`, download: "" }, t("recording.download")),
    ),
  );
}

function streams(summary) {
  const columns = ["recording.stream", "recording.sensors", "recording.rate", "recording.samples", "recording.lost"].map((word) => t(word));
  const head = columns.map((words) => h("th", { scope: "col" }, words));
  const rows = (summary.streams ?? []).map((s) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, stripWords(s.name)),
      [s.sensors.length, t("unit.per_second_of", { rate: Math.round(s.rate) }), whole(s.samples), lost(summary.losses?.[s.name])].map(
        (cell, k) => h("td", { class: "number", "data-column": columns[k + 1] }, String(cell)),
      ),
    ),
  );
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "group", "aria-label": t("recording.streams") },
    h("table", { class: "lined" }, h("thead", {}, h("tr", {}, head)), h("tbody", {}, rows)),
  );
}

const lost = (count) => (count === undefined || count === null ? t("recording.unknown") : count ? whole(count) : t("recording.none"));
