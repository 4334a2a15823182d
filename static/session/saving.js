/** Shows progress of a file made on demand, with a stop button. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

export function saving(api) {
  const element = h("div", { class: "savings small", "aria-live": "polite" });

  /** Ask for it and save it, or say that it was stopped; an error is thrown. */
  async function save(path, file) {
    const asked = new AbortController();
    const words = t("downloads.preparing", { file });
    const line = h(
      "p",
      { class: "saving" },
      h("span", {}, words),
      h("progress", { "aria-label": words }),
      h("button", { type: "button", class: "small", onclick: () => asked.abort() }, t("downloads.stop")),
    );
    element.querySelectorAll(".saved").forEach((old) => old.remove());
    element.append(line);
    try {
      const address = URL.createObjectURL(await api.file(path, asked.signal));
      h("a", { href: address, download: file }).click();
      setTimeout(() => URL.revokeObjectURL(address), 60_000);
    } catch (error) {
      if (asked.signal.aborted) return end(line, t("downloads.stopped", { file }));
      line.remove();
      throw error;
    }
    return end(line, t("downloads.saved", { file }));
  }

  function end(line, words) {
    line.replaceWith(h("p", { class: "saved" }, words));
  }

  return { element, save };
}
