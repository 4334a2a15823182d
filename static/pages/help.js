/** How to go through a session, on one page. */
import { h } from "../dom.js";
import { t } from "../words/words.js";

const STEPS = ["patient", "begin", "connect", "pose", "tasks", "finish", "report"];
const TOPICS = ["ladder", "magnet", "force", "pause", "review", "progress", "together", "clock", "own", "keys"];
const TROUBLES = ["silent", "pose", "hand", "lost", "disk"];

export function mount(root, api, { title }) {
  title(t("help.title"));
  const steps = STEPS.map((name) => h("li", {}, h("strong", {}, t(`help.${name}`)), " ", t(`help.${name}.text`)));
  const explained = (key) => [h("dt", {}, h("strong", {}, t(key))), h("dd", {}, t(`${key}.text`))];
  const topics = TOPICS.map((name) => explained(`help.topic.${name}`));
  const troubles = TROUBLES.map((name) => explained(`help.trouble.${name}`));
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("help.title")), h("p", { class: "soft" }, t("help.lead")))),
    h(
      "div",
      { class: "beside" },
      h(
        "div",
        { class: "stack" },
        h("section", { class: "card" }, h("h2", {}, t("help.steps")), h("ol", { class: "steps-list" }, steps)),
        h("section", { class: "card" }, h("h2", {}, t("help.topics")), h("dl", { class: "troubles" }, topics)),
      ),
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
