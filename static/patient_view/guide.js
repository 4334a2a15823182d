/** What the patient sees: the hand, one title, at most two sentences, seconds in very large digits, the beat, how far the movement goes. */
import { assemble, h, whenChanged } from "../dom.js";
import { counted, t } from "../words/words.js";
import * as beat from "./beat.js";
import * as extent from "./extent.js";
import * as seconds from "./seconds.js";
import * as sound from "./sound.js";

const OWN_WORDS = ["watch", "count", "run"]; // stages in which the task has words
const PARTS = [
  [seconds, "seconds"],
  [beat, "beats"],
  [extent, "extent"],
  [sound, "sound"],
];

export function mount(root, { screen }) {
  const scene = h("div", { class: "scene" });
  const stage = h("p", { class: "stage" });
  const heading = h("h1", {});
  const sentence = h("p", { class: "sentence" });
  const line = h("p", { class: "notice", role: "status", hidden: true }, t("screen.line_lost"));
  const words = h("div", { class: "words", "aria-live": "polite", "aria-atomic": "true" }, stage, heading, sentence);
  const parts = PARTS.map(([part, name]) => [part, h("div", { class: name })]);
  const panel = h("div", { class: "panel" }, line, words, ...parts.map(([, place]) => place));
  root.append(scene, panel);

  const drawScene = whenChanged(
    ({ hand }) => hand, // the other hand has a scene of its own
    (hand) => {
      const title = t("screen.scene", { hand: t(`hand.${hand}.title`) });
      scene.replaceChildren(h("iframe", { src: "/patient-view/scene/", title }));
    },
  );
  const drawWords = whenChanged(
    (state) => [state.stage, state.title, state.instruction, state.passive, state.flowing, state.done, state.pace?.trial],
    ([now, title, instruction, passive, flowing, done]) => {
      root.dataset.stage = now;
      const task = OWN_WORDS.includes(now);
      stage.textContent = t(`screen.stage.${now}`);
      heading.textContent = task ? title : t(`screen.title.${now}`);
      sentence.textContent = sentenceOf(now, task ? instruction : "", { passive, flowing, done });
    },
  );
  const drawMirror = ({ mirrored }) => scene.classList.toggle("mirrored", mirrored);
  const leave = [
    assemble(null, { screen }, parts),
    ...[drawScene, drawWords, drawMirror].map((draw) => screen.on("state", draw)),
    screen.on("line", (stands) => (line.hidden = stands)),
  ];
  return () => {
    leave.forEach((stop) => stop());
    screen.leave();
    delete root.dataset.stage;
  };
}

function sentenceOf(stage, instruction, { passive, flowing, done }) {
  if (passive) return t(stage === "pose" || stage === "hold" ? "screen.passive.pose" : "screen.passive");
  if (instruction) return instruction;
  if (stage === "rest" && done > 1) return counted("screen.rest.counted", done);
  return t(stage === "hold" && !flowing ? "screen.text.wait" : `screen.text.${stage}`);
}
