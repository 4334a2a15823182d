/** A session: while it runs, while it is processed, then its numbers. `?result=` names one of several results. */
import { assemble, h, icon } from "../dom.js";
import { errorBox } from "../forms.js";
import { makeRecord } from "../patient/record.js";
import * as relay from "../relay/notice.js";
import * as reprocess from "../session/reprocess.js";
import * as camera from "../session/camera.js";
import * as changes from "../session/changes.js";
import * as compare from "../session/compare.js";
import * as dating from "../session/dating.js";
import * as empty from "../session/empty.js";
import * as downloads from "../session/downloads.js";
import * as goals from "../session/goals.js";
import * as headlines from "../session/headlines.js";
import * as measures from "../session/measures.js";
import * as notDone from "../session/not_done.js";
import * as notes from "../session/notes.js";
import { foldOnPhone } from "../session/phone_folds.js";
import * as progress from "../session/progress.js";
import * as quality from "../session/quality.js";
import * as ranges from "../session/ranges.js";
import * as recordings from "../session/recordings.js";
import * as references from "../session/references.js";
import * as related from "../session/related.js";
import * as results from "../session/results.js";
import * as selfCalibration from "../session/self_calibration.js";
import * as selfCalibrationGain from "../session/self_calibration_gain.js";
import * as tapping from "../session/tapping.js";
import * as trials from "../session/trials.js";
import * as trunkHeight from "../session/trunk_height.js";
import { clock, day, t, time } from "../words/words.js";

export function mount(root, api, { id, go, title, roles }) {
  const box = errorBox();
  const draft = {}; // a date and a height that are being typed while the session is processed and drawn anew
  let [leave, gone] = [() => {}, false];
  const relayed = h("div", { hidden: true });
  root.append(box.element);
  const stop = relay.mount(relayed, Number(id));

  async function load() {
    try {
      const session = await api.get(`/api/sessions/${id}`);
      const chosen = pick(session);
      const result = chosen && (await api.get(`/api/results/${chosen.id}?${wanted()}`));
      if (gone) return;
      leave();
      root.replaceChildren(box.element, relayed);
      const record = makeRecord(api, session, "sessions");
      const name = ({ started }) => title(t("session.title", { day: day(started), patient: session.patient.pseudonym }));
      record.watch(name);
      name(session);
      const recomputed = (pairs) => (results.follow(pairs, result), load());
      leave = draw(root, api, { session, record, draft, result, go, reload: load, recomputed, treats: roles.includes("clinician") });
    } catch (error) {
      gone || box.show(error, h("p", {}, h("a", { href: "/" }, t("patients.back"))));
    }
  }

  load();
  return () => {
    gone = true;
    stop();
    leave();
  };
}

/** The result that the address names, else what counts now by the way of the first one: others were tried beside it. */
function pick(session) {
  const all = session.recordings.flatMap((recording) => recording.results);
  const named = Number(new URLSearchParams(location.search).get("result"));
  const way = (result) => JSON.stringify([result?.method, result?.parameters]);
  const first = way(all.at(-1));
  const now = all.filter((result) => result.current);
  return all.find((result) => result.id === named) ?? now.find((result) => way(result) === first) ?? now[0] ?? all[0] ?? null;
}

/** What is asked of a result: without what this page does not draw, graded and compared as the address says. */
function wanted() {
  const address = new URLSearchParams(location.search);
  const kept = ["grading", "references"].filter((name) => address.has(name)).map((name) => [name, address.get(name)]);
  return new URLSearchParams([["lean", "true"], ...kept]);
}

function draw(root, api, about) {
  const { session, record, result, treats } = about;
  const done = result?.state === "done";
  const place = (kind = "card") => h("section", { class: kind });
  const numbers = [
    [quality, place()],
    [headlines, place("stack")],
    [ranges, place("stack")],
    [changes, place("stack")],
    [tapping, place("stack")],
    [measures, place("stack")],
  ];
  const placed = (parts) => parts.filter(Boolean).map((part) => [part, place()]);
  const [tasks, kept] = [placed(done ? [trials, compare, camera] : []), placed([recordings, reprocess])];
  const first = placed([treats && session.empty && empty, done && result.readings.not_done.length > 0 && notDone]);
  const closed = session.recordings.some((recording) => recording.sha256);
  const main = [...first, ...(done ? numbers : [[progress, place()]]), ...tasks, ...(closed ? kept : [])];
  const typed = treats ? [notes, dating, closed && trunkHeight.worn(session) && trunkHeight] : [];
  const read = [done && goals, done && references, done && selfCalibrationGain, closed && selfCalibration];
  const aside = placed([...read, ...typed]);
  const [head, choice] = [done ? [[downloads, place("")]] : [], [[results, place("")]]];
  const [name, lead, beside] = [h("h1", {}), h("p", { class: "soft" }), h("div", {})];
  const heading = h("div", {}, trail(session), name, lead, beside);
  const tell = (now) => {
    name.textContent = t("session.heading", { day: day(now.started) });
    lead.textContent = facts(now);
  };
  record.watch(tell);
  tell(session);
  root.append(
    h("div", { class: "head" }, heading, head[0]?.[1]),
    choice[0][1],
    h(
      "div",
      { class: "beside results" },
      h("div", { class: "stack" }, ...main.map(([, place]) => place)),
      h("div", { class: "stack" }, ...aside.map(([, place]) => place)),
    ),
  );
  const further = [...numbers, ...tasks, ...kept, ...aside].filter(([part]) => part !== quality && part !== headlines);
  const leave = assemble(api, about, [[related, beside], ...head, ...choice, ...main, ...aside]);
  if (done) foldOnPhone(further.map(([, place]) => place));
  return leave;
}

function trail(session) {
  return h(
    "p",
    { class: "trail" },
    [h("a", { href: "/" }, t("patients.title")), icon("chevron-right")],
    h("a", { href: `/patients/${session.patient.id}` }, session.patient.pseudonym),
  );
}

function facts(session) {
  return [
    t(`hand.${session.hand}.title`),
    session.dated ? time(session.started) : t("session.undated"),
    session.duration && t("session.length", { clock: clock(session.duration) }),
    session.examiner && t("session.examiner", { name: session.examiner }),
    ...[t(`visits.source.${session.source}`), session.plan.name && t("session.plan", session.plan)],
  ]
    .filter(Boolean)
    .join(" · ");
}
