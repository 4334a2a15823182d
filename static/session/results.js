/** Which of several results is shown: the same recording by other methods or options. */
import { h } from "../dom.js";
import { field, select } from "../forms.js";
import { counted, dayAndTime, t } from "../words/words.js";

export function mount(root, api, { session, result, go }) {
  const all = session.recordings.flatMap((recording) => recording.results);
  if (all.length > 1) {
    const rows = all.map((r) => [String(r.id), resultWords(r)]);
    const choice = select(rows, String(result?.id), { onchange: () => go(`/sessions/${session.id}?result=${choice.value}`, true) });
    root.append(h("div", { class: "card" }, field(t("results.choose"), choice, t("results.hint"))));
    root.classList.add("spaced");
  }
  if (result && !all.find((r) => r.id === result.id)?.current) {
    const now = all.find((r) => r.current);
    const link = now && h("a", { href: `/sessions/${session.id}?result=${now.id}` }, t("results.superseded.now"));
    root.append(h("p", { class: "warning spaced" }, t("results.superseded"), " ", link));
  }
  return () => {};
}

export function resultWords(r) {
  const changed = Object.entries(r.parameters).map(([name, value]) => `${name} = ${value}`);
  return t("results.row", {
    method: r.method,
    options: [changed.join(", ") || t("results.defaults"), r.corrections && counted("corrections", r.corrections)]
      .filter(Boolean)
      .join(", "),
    moment: dayAndTime(r.created),
    state: t(r.current ? `result.state.${r.state}` : "results.before"),
  });
}

/** The address names what stands now in place of the result shown, by pairs { before, now }, where it named one. */
export function follow(pairs, shown) {
  const asked = new URLSearchParams(location.search);
  if (!asked.has("result")) return;
  const now = pairs.find(({ before }) => before === shown?.id)?.now ?? pairs[0]?.now;
  now ? asked.set("result", now) : asked.delete("result");
  history.replaceState(null, "", `${location.pathname}?${asked}`);
}
