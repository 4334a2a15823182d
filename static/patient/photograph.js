/** The pose sheet to print, a photograph of the hand on it, and what photographs told. */
import { h } from "../dom.js";
import { choices, errorBox, field, once } from "../forms.js";
import { dayAndTime, t } from "../words/words.js";
import { metres } from "./lengths.js";
import { correctLandmarks } from "./landmarks.js";
import { figuresTable } from "./photograph_figures.js";
import { sendChange } from "./record.js";

const PAPERS = ["a4", "letter"];

export function mount(root, api, { record }) {
  const box = errorBox();
  const patient = record.now;
  const address = `/api/patients/${patient.id}/photographs`;
  const options = ["left", "right"].map((side) => ({
    value: side,
    label: t(`hand.${side}.title`),
    checked: side === (patient.affected_hand === "right" ? "right" : "left"),
  }));
  const hands = choices(t("photograph.hand"), "photograph_hand", options, "two");
  const sheets = h("p", { class: "buttons" });
  const ruler = h("input", { inputmode: "decimal", autocomplete: "off", name: "ruler", placeholder: "100" });
  const [picture, second] = ["photograph", "second_photograph"].map((name) =>
    h("input", { type: "file", accept: "image/jpeg,image/png", capture: "environment", name }),
  );
  const keep = h("input", { type: "checkbox", name: "keep_picture" });
  const send = h("button", { type: "button", onclick: () => once(send, box, begin) }, t("photograph.begin"));
  const list = h("div", {});
  const marked = new WeakMap(); // by file, so that nobody marks a refused one again
  let gone = false;

  const hand = () => hands.querySelector("input:checked").value;
  const drawSheets = () => {
    const link = (paper) =>
      h(
        "a",
        { class: "button", href: `/api/patients/${patient.id}/pose-sheet.pdf?hand=${hand()}&paper=${paper}` },
        t(`photograph.${paper}`),
      );
    sheets.replaceChildren(...PAPERS.map(link));
  };
  hands.addEventListener("change", drawSheets);
  drawSheets();

  function form(file) {
    const data = new FormData();
    data.append("file", file);
    data.append("hand", hand());
    const length = metres(ruler.value, t("photograph.ruler"));
    if (length !== null) data.append("ruler", String(length));
    return data;
  }

  /** Landmarks of the first file, those of another as `second`, or null where the person gave up. */
  async function correctAll(files) {
    for (const [k, file] of files.entries()) {
      const proposed = await api.upload(`${address}/landmarks`, form(file), () => {});
      const landmarks = marked.get(file) ?? proposed.landmarks;
      const marks = gone ? null : await correctLandmarks(root, file, { ...proposed, landmarks }, k + 1, files.length);
      if (!marks || gone) return null;
      marked.set(file, marks);
    }
    const [first, other] = files.map((file) => marked.get(file));
    return other ? { ...first, second: other } : first;
  }

  async function begin() {
    if (!picture.files[0]) throw new Error(t("photograph.choose"));
    const files = [picture, second].flatMap((input) => [...input.files]);
    const data = form(files[0]);
    const marks = await correctAll(files);
    if (!marks) return;
    data.append("marks", JSON.stringify(marks));
    data.append("keep", keep.checked);
    if (files[1]) data.append("second", files[1]);
    const { id } = await api.upload(address, data, () => {});
    picture.value = second.value = "";
    await show(id);
  }

  /** All that were measured; the one that was made just now is open. */
  async function show(made = null) {
    const all = await api.get(address);
    if (gone) return;
    list.replaceChildren(...all.map((photograph) => one(photograph, photograph.id === made)));
    list.querySelector("details[open] > summary")?.focus();
  }

  function one(photograph, open) {
    const said = h("span", { class: "soft", role: "status" });
    const seen = record.now;
    const take = async () => {
      const measures = structuredClone(seen.hand_measures ?? {});
      measures[photograph.hand] = { ...measures[photograph.hand], ...photograph.geometry };
      if (await sendChange(record, { hand_measures: measures }, box, () => {})) said.textContent = t("photograph.taken");
    };
    const use = h("button", { type: "button", onclick: () => once(use, box, take) }, t("photograph.take"));
    const erase = async () => {
      await api.remove(`/api/photographs/${photograph.id}`);
      await show();
    };
    const gone_for_good = h("button", { type: "button", onclick: () => once(gone_for_good, box, erase) }, t("photograph.erase"));
    const title = t("photograph.title", { hand: t(`hand.${photograph.hand}.title`), when: dayAndTime(photograph.taken) });
    const link =
      photograph.picture && h("a", { class: "button", href: `/api/photographs/${photograph.id}/picture.jpg` }, t("photograph.picture"));
    return h(
      "details",
      { open },
      h("summary", {}, title),
      figuresTable(photograph.table),
      h("div", { class: "buttons" }, use, link, gone_for_good),
      said,
    );
  }

  root.append(
    h(
      "details",
      {},
      h("summary", {}, h("h2", {}, t("photograph.heading"))),
      h("p", { class: "soft" }, t("photograph.lead")),
      hands,
      sheets,
      [
        field(t("photograph.file"), picture, t("photograph.file.hint")),
        field(t("photograph.second"), second, t("photograph.second.hint")),
        field(t("photograph.ruler"), ruler, t("photograph.ruler.hint")),
        h("label", { class: "choice" }, keep, h("span", {}, t("photograph.keep"), h("small", {}, t("photograph.keep.hint")))),
        h("p", {}, send),
      ],
    ),
    box.element,
    list,
  );
  show().catch((error) => gone || box.show(error));
  return () => {
    gone = true;
  };
}
