/** The tones of countdown, start and end on the patient's screen: silent until the patient or the therapist switches them on. */
import { h } from "../dom.js";
import { makeClicks } from "../station/clicks.js";
import { makeCueTones } from "../station/cue_tones.js";
import { t } from "../words/words.js";

const SOUNDING = ["count", "run"];

export function mount(root, api, { screen }) {
  const button = h("button", { type: "button", onclick: () => clicks.set(clicks.state() === "off") });
  const clicks = makeClicks(draw, "handscope-screen-sound", false);
  const tones = makeCueTones(clicks);
  root.append(button);
  clicks.need();
  draw();

  function draw() {
    const on = clicks.state() !== "off";
    button.textContent = t(on ? "metronome.sound.on" : "metronome.sound.off");
    button.setAttribute("aria-pressed", String(on));
  }

  const open = () => clicks.open(); // a browser allows sound from the first press on
  document.addEventListener("pointerdown", open);
  const take = ({ stage, remaining, flowing }) => tones.take(flowing && SOUNDING.includes(stage) ? stage : "", remaining);
  const leave = screen.on("state", take);
  return () => {
    leave();
    document.removeEventListener("pointerdown", open);
    clicks.close();
  };
}
