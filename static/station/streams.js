/** Tokens for programs that read the hand while it is measured (docs/live-stream.md): made here, shown once, ended here. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { t } from "../words/words.js";

export function mount(root, api, { station }) {
  const path = `/api/stations/${station.name}/streams`;
  const box = errorBox();
  const rows = h("ul");
  const secret = h("div", { role: "status" });
  const more = h("button", { type: "button", onclick: () => work(more, permit) }, t("streams.new"));
  const folded = h("details", {}, h("summary", {}, t("streams.title")), h("p", { class: "soft" }, t("streams.lead")), rows, secret, more);
  let gone = false;

  async function list() {
    const open = await api.get(path);
    if (!gone) rows.replaceChildren(...open.map(row));
  }

  function row(stream) {
    const ending = h("button", { type: "button", class: "plain", onclick: () => work(ending, () => end(stream)) }, t("streams.end"));
    return h("li", {}, t("streams.row", stream), " ", ending);
  }

  async function permit() {
    const { token } = await api.post(path);
    const code = `for pose in handscope.stream("${location.origin}", "${token}"):`;
    secret.replaceChildren(h("p", {}, t("streams.once")), h("code", {}, code));
  }

  async function end({ stream }) {
    await api.remove(`${path}/${stream}`);
    secret.replaceChildren();
  }

  const work = (button, task) => once(button, box, () => task().then(list));
  folded.addEventListener("toggle", () => folded.open && list().catch((error) => gone || box.show(error)));
  root.append(folded, box.element);
  return () => (gone = true);
}
