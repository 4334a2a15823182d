/** All patients: search, how many sessions, the last visit; a new one. */
import { h, paced } from "../dom.js";
import { errorBox } from "../forms.js";
import { makeComing } from "../patient/coming.js";
import * as notFinished from "../patient/unfinished.js";
import { pages } from "../paging.js";
import { counted, shortDayAndTime, t } from "../words/words.js";

const PAGE = 50;

export function mount(root, api, { go, title, roles }) {
  title(t("patients.title"));
  const treats = roles.includes("clinician");
  const form = h("section", { class: "card", hidden: true, "aria-label": t("patients.new") });
  const list = h("div", { class: "card" });
  const unfinished = h("div", {});
  const coming = makeComing(() => draw(true));
  const box = errorBox();
  const search = h("input", {
    type: "search",
    "aria-label": t("patients.search"),
    placeholder: t("patients.search"),
    oninput: paced(200, fromTheTop),
  });
  const archived = h("input", { type: "checkbox", onchange: fromTheTop });
  const opener = h("button", { class: "primary large clinicians", onclick: open, "aria-expanded": "false" }, t("patients.new"));
  let leaveForm = null;
  const erased = h("div", {});
  const emergencies = h("div", { class: "stack" });
  let [leaveErased, leaveEmergencies] = [() => {}, () => {}];
  let gone = false;
  let asked = 0;
  let offset = 0;

  async function open() {
    if (leaveForm) return close();
    const { newPatient } = (await loadRest().catch(box.show)) ?? {};
    if (!newPatient || leaveForm || gone) return; // or pressed twice
    form.hidden = false;
    opener.setAttribute("aria-expanded", "true");
    leaveForm = newPatient.mount(form, api, { done: (patient) => go(`/patients/${patient.id}`), cancel: close });
  }

  function close() {
    leaveForm?.();
    leaveForm = null;
    form.hidden = true;
    opener.setAttribute("aria-expanded", "false");
    opener.focus();
  }

  function fromTheTop() {
    offset = 0;
    return draw();
  }

  async function turn(to) {
    offset = to;
    await draw();
    list.scrollIntoView({ block: "nearest" });
    list.querySelector("a")?.focus();
  }

  async function draw(again = false) {
    const mine = (asked += 1);
    const words = search.value.trim();
    try {
      const query = new URLSearchParams({ search: words, archived: String(archived.checked), offset: String(offset), limit: String(PAGE) });
      const found = await api.some(`/api/patients?${query}`);
      const { erasures } = archived.checked ? await loadRest() : {};
      if (mine !== asked) return;
      box.clear();
      leaveErased();
      erased.replaceChildren();
      leaveErased = erasures && (treats || roles.includes("administrator")) ? erasures.mount(erased, api) : () => {};
      coming.take(found.rows);
      const at = again && list.contains(document.activeElement) && document.activeElement.getAttribute("href");
      const some = found.rows.length > 0;
      list.replaceChildren(...(some ? [table(found.rows), pages(found, offset, PAGE, turn)] : [nobody(words, archived.checked)]));
      if (at) list.querySelector(`a[href="${at}"]`)?.focus();
    } catch (error) {
      if (mine === asked) box.show(error, h("button", { type: "button", onclick: () => draw() }, t("patients.retry")));
    }
    list.hidden = !list.childElementCount;
  }

  const found = h("div", {}, searchRow(search, archived), box.element, coming.element, list);
  const below = h("div", { class: "stack", hidden: treats }, form, found, emergencies, erased);
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("patients.title")), h("p", { class: "soft" }, t("patients.lead"))), opener),
    unfinished,
    below,
  );
  const drawn = draw();
  const above = treats ? notFinished.mount(unfinished, api) : null;
  above?.said.then(() => (below.hidden = false)); // else it would be moved down
  const showEmergencies = ({ emergency }) => gone || (leaveEmergencies = emergency.mount(emergencies, api, { go }));
  if (treats) drawn.then(loadRest).then(showEmergencies, box.show);
  return () => {
    gone = true;
    above?.leave();
    leaveEmergencies();
    leaveErased();
    coming.leave();
    asked += 1;
    leaveForm?.();
  };
}

/** What the first view does not show, loaded after it. */
async function loadRest() {
  const parts = [import("../patient/new_patient.js"), import("../patient/emergency.js"), import("../patient/erasures.js")];
  const [newPatient, emergency, erasures] = await Promise.all(parts).catch(() => Promise.reject(new Error(t("error.unreachable"))));
  return { newPatient, emergency, erasures };
}

function searchRow(search, archived) {
  return h("div", { class: "search", role: "search" }, search, h("label", { class: "check" }, archived, t("patients.archived")));
}

function table(patients) {
  const head = ["patients.pseudonym", "patients.sessions", "patients.last", "patients.affected"].map((word) =>
    h("th", { scope: "col" }, t(word)),
  );
  const rows = patients.map((p) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, h("a", { href: `/patients/${p.id}` }, p.pseudonym)),
      h("td", {}, p.sessions ? counted("sessions", p.sessions) : t(p.planned ? "coming.row" : "patients.none_yet")),
      h("td", { class: p.last_session ? "" : "none" }, p.last_session ? shortDayAndTime(p.last_session) : "–"),
      h("td", {}, p.affected_hand ? t(`hand.${p.affected_hand}`) : "–"),
    ),
  );
  const list = h("table", { class: "rows patients" }, h("thead", {}, h("tr", {}, head)), h("tbody", {}, rows));
  return h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("patients.title") }, list);
}

function nobody(words, archived) {
  const [head, body] = words
    ? ["patients.unmatched", "patients.unmatched.next"]
    : archived
      ? ["patients.no_archive", "patients.no_archive.next"]
      : ["patients.empty", "patients.empty.next"];
  return h("p", { class: "empty" }, h("strong", {}, t(head, { words })), t(body));
}
