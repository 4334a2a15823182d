/** Where a session stands that has no numbers yet: it runs, it is being processed, or it failed; looks again until that changes. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { progressBar } from "../progress_bar.js";
import { t } from "../words/words.js";

const PAUSE = 700; // ms between two looks

export function mount(root, api, { session, result, reload }) {
  const box = errorBox();
  let timer = 0;
  if (session.state === "open") {
    root.append(
      h("h2", {}, t(session.saving ? "progress.saving" : "progress.open")),
      h("p", { role: "status" }, t(session.saving ? "progress.saving.next" : "progress.open.next")),
      ...(session.station ? [h("a", { class: "button primary large", href: `/stations/${session.station}` }, t("progress.open.go"))] : []),
    );
    timer = session.station ? 0 : setTimeout(reload, PAUSE);
  } else if (session.state === "failed") {
    const reason = session.recordings.map((recording) => recording.summary?.problem).find(Boolean);
    box.show(new Error(reason ?? t("progress.nothing")));
    root.append(
      h("h2", {}, t("progress.failed")),
      box.element,
      h("p", {}, t("progress.failed.next")),
      h("a", { class: "button primary", href: `/patients/${session.patient.id}` }, t("progress.to_patient")),
    );
  } else if (result?.state === "failed") {
    box.show(new Error(result.error));
    root.append(h("h2", {}, t("progress.unusable")), box.element, h("p", {}, t("progress.unusable.next")));
  } else {
    const bar = progressBar(t("progress.working"));
    root.append(h("div", { role: "status" }, h("h2", {}, t("progress.working"))), bar.element, box.element);
    if (result) root.append(h("p", {}, h("button", { type: "button", onclick: stop }, t("progress.stop"))));
    watch(bar);
  }

  async function stop({ currentTarget }) {
    currentTarget.disabled = true;
    try {
      await api.remove(`/api/results/${result.id}/computation`);
      if (timer !== null) reload();
    } catch (error) {
      box.show(error);
      currentTarget.disabled = false;
    }
  }

  async function watch(bar) {
    try {
      const now = result && (await api.get(`/api/results/${result.id}?lean=true`));
      if (timer === null) return;
      box.clear();
      bar.set(now?.progress ?? 0, t(now?.state === "running" ? "progress.running" : "progress.queued"));
      if (!now) timer = setTimeout(reload, PAUSE);
      else if (!["queued", "running"].includes(now.state)) reload();
      else timer = setTimeout(() => watch(bar), PAUSE);
      return;
    } catch (error) {
      box.show(error);
    }
    if (timer !== null) timer = setTimeout(() => watch(bar), PAUSE);
  }

  return () => {
    clearTimeout(timer);
    timer = null;
  };
}
