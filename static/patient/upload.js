/** Upload a recording made elsewhere: drop it or choose it, then to its session. */
import { h } from "../dom.js";
import { choices, errorBox, field, onSubmit, select } from "../forms.js";
import { progressBar } from "../progress_bar.js";
import { labelled } from "../words/joined.js";
import { t } from "../words/words.js";

const RECORDINGS = /\.(zip|mcap)$/i;
const TABLES = /\.(csv|tsv|txt|xlsx|parquet|mat|xdf|mvnx|bvh|h5|hdf5)$/i; // their columns are mapped on a page of its own

export function mount(root, api, { record, go }) {
  const box = errorBox();
  const input = h("input", {
    type: "file",
    accept: ".zip,.mcap,.csv,.tsv,.txt,.xlsx,.parquet,.mat,.xdf,.mvnx,.bvh,.h5,.hdf5",
    class: "visually-hidden",
    tabindex: "-1",
    "aria-label": t("upload.file"),
    onchange: () => take(input.files[0]),
  });
  const name = h("strong", {}, t("upload.drop"));
  const pick = h("button", { type: "button", onclick: () => input.click() }, t("upload.choose"));
  const area = h("div", { class: "drop" }, h("p", {}, name), pick, input, h("p", { class: "hint" }, t("upload.kinds")));
  let sending = new AbortController();
  const bar = progressBar(t("upload.progress"), () => sending.abort(), t("upload.stop"));
  const more = h("div", { hidden: true });
  const send = h("button", { class: "primary large", type: "submit", disabled: true }, t("upload.send"));
  const form = h("form", { novalidate: true }, area, more, bar.element, box.element, h("p", {}, send));
  let file = null;
  let asked = false; // the method and the hand
  let gone = false;
  bar.element.hidden = true;

  const isTable = () => TABLES.test(file?.name ?? "");
  const ready = () => (send.disabled = !(file && (asked || isTable())));

  function take(given) {
    box.clear();
    if (!given) return;
    file = RECORDINGS.test(given.name) || TABLES.test(given.name) ? given : null;
    name.textContent = given.name;
    ready();
    more.hidden = !file || isTable();
    send.textContent = t(isTable() ? "upload.map" : "upload.send");
    pick.textContent = t("upload.another");
    if (!file) box.show(new Error(t("upload.wrong_kind", { name: given.name })));
  }

  const over = (event, inside) => {
    event.preventDefault();
    area.classList.toggle("over", inside);
  };
  area.addEventListener("dragover", (event) => over(event, true));
  area.addEventListener("dragleave", (event) => over(event, false));
  area.addEventListener("drop", (event) => {
    over(event, false);
    take(event.dataTransfer.files[0]);
  });

  api.get("/api/methods").then(
    (methods) => {
      if (gone) return;
      const hands = ["", "left", "right"].map((side) => ({
        value: side,
        label: t(side ? `hand.${side}.title` : "upload.hand.recording"),
        checked: !side,
      }));
      const method = select(
        [["", t("upload.method.suited")], ...methods.map((m) => [m.name, labelled(m.name, m.title)])],
        "",
        { name: "method" },
      );
      more.replaceChildren(h("p", {}), choices(t("upload.hand"), "upload_hand", hands), field(t("upload.method"), method));
      asked = true;
      ready();
    },
    (error) => gone || box.show(error),
  );

  onSubmit(form, box, async () => {
    const data = new FormData();
    data.append("file", file);
    if (!isTable() && form.elements.method.value) data.append("method", form.elements.method.value);
    if (!isTable() && form.elements.upload_hand.value) data.append("hand", form.elements.upload_hand.value);
    sending = new AbortController();
    bar.set(0, t("upload.sending"));
    bar.element.hidden = false;
    try {
      const address = `/patients/${record.now.id}/${isTable() ? "tables" : "recordings"}`;
      const sent = (share) => bar.set(share, t(share < 1 ? "upload.sending" : "upload.checking"), share < 1);
      const kept = await api.upload(`/api${address}`, data, sent, sending.signal);
      go(kept.table ? `${address}/${kept.table}` : `/sessions/${kept.session}`);
    } finally {
      bar.element.hidden = true;
    }
  });
  root.append(h("h2", {}, t("upload.title")), h("p", { class: "soft" }, t("upload.lead")), form);
  return () => {
    gone = true;
  };
}
