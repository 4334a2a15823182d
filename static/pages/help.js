/** How to go through a session, on one page. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

const STEPS = ["patient", "begin", "connect", "pose", "tasks", "finish", "report"];
const TROUBLES = ["silent", "pose", "hand", "lost", "disk"];

export function mount(root, api, { title }) {
  title(t("help.title"));
  const steps = STEPS.map((name) => h("li", {}, h("strong", {}, t(`help.${name}`)), " ", t(`help.${name}.text`)));
  const troubles = TROUBLES.map((name) => [
    h("dt", {}, h("strong", {}, t(`help.trouble.${name}`))),
    h("dd", {}, t(`help.trouble.${name}.text`)),
  ]);
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("help.title")), h("p", { class: "soft" }, t("help.lead")))),
    h(
      "div",
      { class: "beside" },
      h("section", { class: "card" }, h("h2", {}, t("help.steps")), h("ol", { class: "steps-list" }, steps)),
      h(
        "div",
        { class: "stack" },
        h("section", { class: "card" }, h("h2", {}, t("help.trouble")), h("dl", { class: "troubles" }, troubles)),
        h("section", { class: "card" }, h("h2", {}, t("help.upload")), h("p", {}, t("help.upload.text"))),
        h("section", { class: "card" }, h("h2", {}, t("help.care")), h("p", {}, t("help.care.text"))),
      ),
    ),
  );
  return () => {};
}
