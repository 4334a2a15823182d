/** What is wrong with glove or recording, in red and unmistakable, with what to do. */
import { h, lasting, whenChanged } from "../dom.js";
import { t } from "../words/words.js";

const QUIET = 2000; // ms without data that are worth an alarm

export function mount(root, api, { station }) {
  root.setAttribute("role", "alert");
  const silent = lasting(QUIET);
  const draw = whenChanged(
    ({ glove, wizard }) => problem(glove, silent(!glove.flowing && wizard.state !== "connect" && wizard.state !== "finished")),
    (alarm) => {
      root.hidden = !alarm;
      root.replaceChildren(...(alarm ? [h("strong", {}, alarm.head), h("span", {}, alarm.next)] : []));
    },
  );
  return station.on("full", draw);
}

/** The gravest problem, or null. */
function problem(glove, silent) {
  if (glove.state === "finished") return null;
  if (glove.state === "recording_failed")
    return { head: t("problem.recording"), next: t("problem.recording.next", { reason: glove.reason }) };
  if (glove.problem) return { head: t("problem.glove"), next: glove.problem };
  if (glove.state === "port_lost") return { head: t("problem.lost"), next: t("problem.lost.next") };
  if (glove.state === "port_closed") return { head: t("problem.closed"), next: t("problem.closed.next", { reason: glove.reason }) };
  if (silent) return { head: t("problem.silent"), next: t("problem.silent.next") };
  return null;
}
