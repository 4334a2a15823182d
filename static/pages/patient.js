/** A patient: begin a session, upload a recording, what was done before, facts, hand measures, notes. */
import { assemble, h } from "../dom.js";
import { errorBox } from "../forms.js";
import { banner, openedInEmergency } from "../patient/emergency.js";
import * as facts from "../patient/facts.js";
import * as keeping from "../patient/keeping.js";
import { makeKept } from "../patient/stored_calibrations.js";
import * as measures from "../patient/measures.js";
import * as newSession from "../patient/new_session.js";
import * as notes from "../patient/notes.js";
import { makeRecord } from "../patient/record.js";
import * as selfCalibrations from "../patient/self_calibrations.js";
import * as notFinished from "../patient/unfinished.js";
import * as photograph from "../patient/photograph.js";
import { makeCourse } from "../progress/course.js";
import * as glance from "../progress/glance.js";
import * as progress from "../progress/progress.js";
import * as upload from "../patient/upload.js";
import * as visits from "../patient/visits.js";
import { counted, t } from "../words/words.js";

export function mount(root, api, { id, go, title, roles }) {
  const box = errorBox();
  let leave = () => {};
  let gone = false;
  root.append(box.element);
  api.get(`/api/patients/${id}`).then(
    (patient) => {
      if (gone) return;
      const record = makeRecord(api, patient);
      const heading = h("h1", {});
      const about = h("p", { class: "soft" });
      const name = (now) => {
        heading.textContent = now.pseudonym;
        about.textContent = summary(now);
        title(now.pseudonym);
      };
      name(patient);
      const stop = record.watch(name);
      const treats = roles.includes("clinician"); // who does not is shown what was measured, and nothing that the server refuses
      const place = (part) => [part, h("section", { class: "card" })];
      const compared = glance.isRepeated(patient.sessions);
      const seen = compared ? [[glance, h("section", { class: "key-figures" })]] : [];
      const main = [treats && newSession, ...(compared ? [progress, visits] : [visits, progress])].filter(Boolean).map(place);
      const aside = (
        treats ? [facts, notes, upload, measures, photograph, selfCalibrations, keeping] : [facts, measures, selfCalibrations]
      ).map(place);
      const [warning, running] = [h("div", {}), h("div", {})];
      const runs = treats && patient.sessions.some(({ state }) => state === "open");
      const stopRunning = runs ? notFinished.mount(running, api, patient.id).leave : () => {};
      banner(api, patient, () => go("/")).then((shown) => shown && warning.append(shown), box.show);
      const opened = openedInEmergency(patient.emergency_accesses);
      root.append(
        warning,
        running,
        h(
          "div",
          { class: "head" },
          h("div", {}, h("p", { class: "trail" }, h("a", { href: "/" }, t("patients.title"))), heading, about),
          seen.map(([, part]) => part),
        ),
        h(
          "div",
          { class: "beside" },
          [main, aside].map((stack) =>
            h(
              "div",
              { class: "stack" },
              stack.map(([, part]) => part),
              stack === aside && opened,
            ),
          ),
        ),
      );
      const erased = (counts) => {
        leave();
        leave = () => {};
        root.replaceChildren(farewell(counts));
        root.querySelector("a").focus();
      };
      const shared = { record, course: makeCourse(api, id), kept: makeKept(api, id), go, erased, treats };
      const unmount = assemble(api, shared, [...seen, ...main, ...aside]);
      leave = () => {
        stop();
        stopRunning();
        unmount();
      };
    },
    (error) => gone || box.show(error, h("p", {}, h("a", { href: "/" }, t("patients.back")))),
  );
  return () => {
    gone = true;
    leave();
  };
}

/** What stands where an erased patient's page was. */
function farewell(counts) {
  return h(
    "section",
    { class: "card empty", role: "status" },
    h("strong", {}, t("erased.title")),
    h("p", {}, t("erased.what", { sessions: counted("sessions", counts.sessions) })),
    h("a", { class: "button primary", href: "/" }, t("patients.back")),
  );
}

function summary(patient) {
  return [
    patient.year_of_birth && t("patient.born", { year: patient.year_of_birth }),
    patient.dominant_hand && t(`patient.dominant.${patient.dominant_hand}`),
    patient.affected_hand && t(`patient.affected.${patient.affected_hand}`),
    patient.archived && t("patient.archived"),
  ]
    .filter(Boolean)
    .join(" · ");
}
