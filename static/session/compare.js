/** This result beside another: by another method, of the other hand, of another session. */
import { h } from "../dom.js";
import { errorBox, once, select } from "../forms.js";
import { chooseCurve } from "../plots/curve_sets.js";
import { progressBar } from "../progress_bar.js";
import { labelled } from "../words/joined.js";
import { dayAndTime, t } from "../words/words.js";
import * as compared from "./compared.js";
import { trialsOf } from "./trials.js";

const PAUSE = 500; // ms between two looks at a computation

export function mount(root, api, { session, result, go }) {
  const box = errorBox();
  const body = h("div", {});
  const summary = h("summary", {}, h("h2", {}, t("compare.title")));
  const details = h("details", { ontoggle: () => details.open && begin() }, summary, body, box.element);
  const file = session.recordings.find((recording) => recording.id === result.recording);
  let leave = () => {};
  let begun = false;
  let asked = 0;
  root.append(details);

  async function begin() {
    if (begun) return;
    begun = true;
    try {
      const [methods, course, titles] = await Promise.all([
        api.get("/api/methods"),
        api.get(`/api/patients/${session.patient.id}/progress`),
        api.titles().catch(() => new Map()),
      ]);
      if (asked >= 0) draw(methods, course, trialsOf(file, titles));
    } catch (error) {
      begun = false;
      box.show(error);
    }
  }

  function draw(methods, course, trials) {
    const other = choiceOfOther(methods, course, session, result, show);
    const parts = [["", t("compare.whole")], ...trials.map((one) => [String(one.event), one.name])];
    const trial = select(parts, "", { "aria-label": t("compare.trial"), onchange: show });
    const what = chooseCurve(trials[0]?.tapping, show);
    const place = h("div", {});
    const both = h("button", { hidden: true }, t("compare.both"));
    if (other.options.length < 2) return void body.replaceChildren(h("p", { class: "soft" }, t("compare.nothing")));
    body.replaceChildren(h("p", { class: "soft" }, t("compare.lead")), h("div", { class: "course-head" }, other, trial, what, both), place);

    async function show() {
      const mine = (asked += 1);
      both.hidden = true;
      if (!other.value) return;
      const [kind, value] = other.value.split(":");
      const alone = kind === "session";
      if (alone && !trial.value && trials.length) trial.value = String(trials[0].event);
      trial.options[0].disabled = alone;
      try {
        box.clear();
        const id = kind === "method" ? await computed(value, place, () => mine === asked) : Number(value);
        if (mine !== asked || id === null) return;
        const query = new URLSearchParams({ other: id, what: what.value, ...(trial.value && { event: trial.value }) });
        const payload = await api.get(`/api/results/${result.id}/comparison?${query}`);
        if (mine !== asked) return;
        leave();
        const names = [t("compare.this"), kind === "method" ? value : other.selectedOptions[0].textContent];
        leave = compared.mount(place, api, { payload, what: what.value, names });
        const address = `/api/results/${result.id}/replay?${new URLSearchParams({ other: id, at: payload.offsets[0] })}`;
        both.onclick = () => once(both, box, async () => go(`/stations/${(await api.post(address)).station}`));
        both.hidden = false;
      } catch (error) {
        if (mine !== asked) return;
        leave();
        place.replaceChildren();
        box.show(error);
      }
    }
  }

  /** The result by a method, computed where there is none; null when nobody waits any longer. */
  async function computed(method, place, wanted) {
    const { result: id } = await api.post(`/api/sessions/${session.id}/results`, { method, options: {} });
    const bar = progressBar(t("progress.working"));
    for (;;) {
      const now = await api.get(`/api/results/${id}?lean=true`);
      if (!wanted()) return null;
      if (now.state === "done") return id;
      if (now.state === "failed") throw new Error(now.error);
      if (!bar.element.isConnected) place.replaceChildren(bar.element);
      bar.set(now.progress, t("compare.computing", { method }));
      await new Promise((later) => setTimeout(later, PAUSE));
    }
  }

  return () => {
    asked = -1;
    leave();
  };
}

/** The same tasks of the other hand and of other sessions, then this recording by other methods. */
function choiceOfOther(methods, course, session, result, onchange) {
  const sessions = Object.entries(course.sessions).flatMap(([hand, all]) => all.map((one) => ({ ...one, hand })));
  const words = (one) => t("compare.session", { day: dayAndTime(one.started), hand: t(`hand.${one.hand}.title`) });
  const those = (wanted) => sessions.filter(wanted).map((one) => [`session:${one.result}`, words(one)]);
  const groups = [
    ["compare.other_hand", those((one) => one.hand !== session.hand)],
    ["compare.sessions", those((one) => one.hand === session.hand && one.session !== session.id)],
    ["compare.method", methods.filter((m) => m.name !== result.method).map((m) => [`method:${m.name}`, labelled(m.name, m.title)])],
  ];
  const options = (all) => all.map(([value, text]) => h("option", { value }, text));
  const filled = groups.filter(([, all]) => all.length);
  return h(
    "select",
    { "aria-label": t("compare.with"), onchange },
    h("option", { value: "" }, t("compare.choose")),
    filled.map(([word, all]) => h("optgroup", { label: t(word) }, options(all))),
  );
}
