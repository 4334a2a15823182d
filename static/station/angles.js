/** The joint angles of this moment, in words; a few times a second, so that they can be read. */
import { h, paced, whenChanged } from "../dom.js";
import { angleWords } from "../words/clinical.js";
import { t } from "../words/words.js";
import { HAND_ROWS } from "./joint_rows.js";

const PAUSE = 200; // ms

export function mount(root, api, { station }) {
  const columns = ["angles.finger", "angles.base", "angles.middle", "angles.end"].map((word) => h("th", { scope: "col" }, t(word)));
  const body = h("tbody", {});
  const table = h("table", { class: "compact" }, h("thead", {}, h("tr", {}, columns)), body);
  const empty = h("p", { class: "soft small" }, t("angles.empty"));
  const box = h("details", {}, h("summary", {}, t("angles.title")), empty, table);
  root.append(box);
  const draw = whenChanged((pulse) => wordsOf(pulse.angles), rows);

  function rows(wordsByJoint) {
    const shown = HAND_ROWS.filter(([, joints]) => joints.some((joint) => wordsByJoint[joint]));
    empty.hidden = shown.length > 0;
    table.hidden = !shown.length;
    body.replaceChildren(
      ...shown.map(([finger, joints]) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, t(`finger.${finger}`)),
          joints.map((joint) =>
            h(
              "td",
              { class: "number", colspan: joints.length === 1 && 3 },
              (wordsByJoint[joint] ?? ["–"]).map((words) => h("div", {}, words)),
            ),
          ),
        ),
      ),
    );
  }

  return station.on(
    "pulse",
    paced(PAUSE, (pulse) => box.open && draw(pulse)),
  );
}

/** Words of every angle by joint. */
function wordsOf(angles) {
  const wordsByJoint = {};
  angles.forEach(({ joint, angle, deg }) => (wordsByJoint[joint] ??= []).push(angleWords(joint, angle, deg)));
  return wordsByJoint;
}
