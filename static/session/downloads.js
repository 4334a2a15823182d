/** What can be taken away: the report, tables, the movement; and the replay. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { language } from "../words/languages.js";
import { t } from "../words/words.js";
import { versionOf } from "./references.js";
import { saving } from "./saving.js";

export function mount(root, api, { session, result, go }) {
  const box = errorBox();
  const { element: status, save } = saving(api);
  const base = `/api/results/${result.id}`;
  const name = (end) => `handscope-session-${session.id}-${result.method}${end}`;

  /** A file that is made on demand: asked for, then saved; its error is said here and not in an empty window. */
  function saved(words, path, file, look = "clinicians") {
    const button = h("button", { class: look, onclick: () => once(button, box, () => save(path, file)) }, words);
    return button;
  }

  /** A report in a window of its own. */
  function opened(words, href, look = "button clinicians") {
    return h("a", { class: look, href, target: "_blank", rel: "noopener" }, words);
  }

  const replay = h(
    "button",
    { class: "large", onclick: () => once(replay, box, async () => go(`/stations/${(await api.post(`${base}/replay`)).station}`)) },
    t("downloads.replay"),
  );
  const named = h("input", { type: "checkbox", id: "replay-named" });
  const file = h(
    "button",
    { onclick: () => once(file, box, () => save(`${base}/replay.html${named.checked ? "?named=true" : ""}`, name("-replay.html"))) },
    t("downloads.replay_file"),
  );
  const asked = new URLSearchParams({ language, grading: result.grading, ...versionOf(result) });
  const tables = [
    opened(t("downloads.html"), `${base}/report.html?${asked}`),
    opened(t("downloads.letter"), `${base}/report.pdf?${asked}&paper=us-letter`),
    saved(t("downloads.csv"), `${base}/report.csv?${asked}`, name(".csv")),
    saved(t("downloads.json"), `${base}/report.json?${asked}`, name(".json")),
    saved(t("downloads.derivative"), `${base}/derivative.zip`, name(".zip"), ""),
  ];
  const row = (element) => h("li", {}, element);
  const formats = h("ul", { class: "formats" });
  const exported = (f) => saved(f.title, `${base}/exports/${f.name}`, name(`-${f.name}${f.suffix}`), "");
  const offer = () =>
    api.get(`${base}/exports`).then(
      (all) => formats.replaceChildren(...all.map((f) => row(exported(f)))),
      box.show,
    );
  root.append(
    h(
      "div",
      { class: "buttons" },
      opened(t("downloads.pdf"), `${base}/report.pdf?${asked}`, "button primary large clinicians"),
      replay,
    ),
    h(
      "details",
      { class: "more", ontoggle: () => formats.children.length || offer() },
      h("summary", {}, t("downloads.more")),
      h("ul", { class: "formats" }, tables.map(row)),
      h("p", { class: "hint" }, t("downloads.formats")),
      formats,
      h(
        "div",
        { class: "buttons" },
        file,
        h("label", { class: "inline clinicians", for: "replay-named" }, named, t("downloads.replay_named")),
      ),
      h("p", { class: "hint" }, t("downloads.replay_hint")),
      status,
    ),
    box.element,
  );
  return () => {};
}
