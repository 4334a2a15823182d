/** A live session: the wizard that leads it, the curve under test, and how glove and recording are. */
import { assemble, h, whenChanged } from "../dom.js";
import * as actions from "./actions.js";
import * as angles from "./angles.js";
import * as banner from "./banner.js";
import * as relayed from "./relayed.js";
import * as check from "./check.js";
import * as countdown from "./countdown.js";
import * as cues from "./cues.js";
import * as curve from "./live_curve.js";
import * as ending from "./ending.js";
import * as following from "./following.js";
import * as findings from "./findings.js";
import * as freeMovement from "./free_movement.js";
import * as glove from "./glove.js";
import * as guidance from "./guidance.js";
import * as joints from "./joints.js";
import * as measuredPose from "./measured_pose.js";
import * as metronome from "./metronome.js";
import * as numbers from "./numbers.js";
import * as poseFit from "./pose_fit.js";
import * as quantity from "./quantity.js";
import * as screens from "./screens.js";
import * as recording from "./recording.js";
import * as otherHand from "./other_hand.js";
import * as score from "./score.js";
import * as stillness from "./stillness.js";
import * as stiffJoints from "./stiff_joints.js";
import * as streams from "./streams.js";
import * as steps from "./steps.js";
import * as tasks from "./tasks.js";
import * as trial from "./trial.js";
import * as trackers from "./trackers.js";
import * as handPosition from "./hand_position.js";
import { t } from "../words/words.js";

// [module, its class, where it goes: over the scene, in the scene, in the strip, or the element in the side panel]
const PARTS = [
  [banner, "banner", "over"],
  [metronome, "metronome", "over"],
  [cues, "cues", "over"],
  [countdown, "countdown", "over"],
  [recording, "recording", "scene"],
  [following, "following", "over"],
  [quantity, "quantity", "over"],
  [curve, "curve", "strip"],
  [numbers, "numbers", "strip"],
  [relayed, "relayed", "div"],
  [steps, "steps", "div"],
  [guidance, "guidance", "div"],
  [trackers, "trackers", "section"],
  [check, "sensors", "div"],
  [findings, "findings", "div"],
  [stillness, "stillness", "div"],
  [poseFit, "pose-fit", "div"],
  [score, "score", "div"],
  [trial, "trial-review", "div"],
  [stiffJoints, "stiff-joints", "div"],
  [actions, "actions", "div"],
  [measuredPose, "measured-pose", "div"],
  [freeMovement, "free", "div"],
  [otherHand, "other-hand", "div"],
  [ending, "ending", "div"],
  [tasks, "tasks", "section"],
  [handPosition, "hand-position", "section"],
  [joints, "joints", "section"],
  [angles, "angles", "section"],
  [glove, "glove", "section"],
  [screens, "screens", "section"],
  [streams, "streams", "section"],
];

export function mount(root, api, about) {
  const { scene, strip, station, session } = about;
  const over = h("div", { class: "over" });
  const who = h(
    "h1",
    { class: "who" },
    t("station.who", { hand: t(`hand.${station.latest.hand}.title`), patient: session.patient.pseudonym }),
  );
  scene.append(over);
  root.append(who);
  const places = { over, scene, strip };
  const parts = PARTS.map(([part, name, where]) => {
    const place = h(where === "section" ? "section" : "div", { class: name });
    (places[where] ?? root).append(place);
    return [part, place];
  });
  const leave = [
    assemble(api, { ...about, given: { score: null } }, parts),
    station.on(
      "full",
      whenChanged(
        (full) => full.wizard.state,
        () => (root.scrollTop = 0),
      ),
    ),
  ];
  return () => leave.forEach((unmount) => unmount());
}
