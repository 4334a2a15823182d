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
  const picture = h("input", { type: "file", accept: "image/jpeg,image/png", capture: "environment", name: "photograph" });
  const keep = h("input", { type: "checkbox", name: "keep_picture" });
  const send = h("button", { type: "button", onclick: () => once(send, box, begin) }, t("photograph.begin"));
  const list = h("div", {});
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

  function form() {
    const data = new FormData();
    data.append("file", picture.files[0]);
    data.append("hand", hand());
    const length = metres(ruler.value, t("photograph.ruler"));
    if (length !== null) data.append("ruler", String(length));
    return data;
  }

  async function begin() {
    if (!picture.files[0]) throw new Error(t("photograph.choose"));
    const data = form();
    const proposed = await api.upload(`${address}/landmarks`, data, () => {});
    const marks = await correctLandmarks(root, picture.files[0], proposed);
    if (!marks || gone) return;
    data.append("marks", JSON.stringify(marks));
    data.append("keep", keep.checked);
    await api.upload(address, data, () => {});
    picture.value = "";
    await show();
  }

  async function show() {
    const all = await api.get(address);
    if (!gone) list.replaceChildren(...all.map(one));
  }

  function one(photograph) {
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
      {},
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
