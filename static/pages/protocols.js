/** Protocols by diagnosis: a list, and the one that is chosen to be changed, exported or taken from a file. */
import { h } from "../dom.js";
import { errorBox, once } from "../forms.js";
import { editor } from "../protocols/editor.js";
import { t } from "../words/words.js";

export function mount(root, api, { title }) {
  title(t("protocols.title"));
  const box = errorBox();
  const list = h("ul", { class: "plan-list" });
  const place = h("section", { class: "card" });
  const file = h("input", { type: "file", accept: ".json,application/json", "aria-label": t("protocols.import"), hidden: true });
  const bring = h("button", { type: "button", onclick: () => file.click() }, t("protocols.import"));
  const fresh = h("button", { type: "button", onclick: () => edit(null) }, t("protocols.new"));
  let tasks = [];
  let plans = [];
  let gone = false;
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("protocols.title")), h("p", { class: "soft" }, t("protocols.lead")))),
    box.element,
    h(
      "div",
      { class: "beside plans" },
      h("section", { class: "card" }, list, h("div", { class: "buttons" }, fresh, bring, file)),
      place,
    ),
  );
  file.addEventListener("change", () => once(bring, box, take));

  async function load(chosen) {
    [plans, tasks] = await Promise.all([api.get("/api/assessment-plans"), api.get("/api/protocols")]);
    if (gone) return;
    const now = plans.find((plan) => plan.name === chosen) ?? plans[0] ?? null;
    edit(now);
  }

  function edit(plan) {
    list.replaceChildren(...plans.map((one) => row(one, one === plan)));
    place.replaceChildren(editor(api, { plan, plans, tasks, stored: load }));
  }

  function row(plan, current) {
    const about = t(plan.own ? "protocols.own" : "protocols.given", { version: plan.version });
    const words = [h("span", {}, plan.title), h("small", {}, about)];
    const choose = { type: "button", class: "plain", "aria-current": current && "true", onclick: () => edit(plan) };
    return h("li", {}, h("button", choose, words));
  }

  /** A file of another house: the next version of a protocol of that name here. */
  async function take() {
    const text = await file.files[0].text();
    file.value = "";
    let content = null;
    try {
      content = JSON.parse(text);
    } catch {
      throw new Error(t("protocols.no_json"));
    }
    const seen = plans.find((plan) => plan.name === content?.name)?.version ?? 0;
    const made = await api.post("/api/assessment-plans", { content, seen });
    await load(made.name);
  }

  load().catch((error) => gone || box.show(error));
  return () => {
    gone = true;
  };
}
