/** Links beside a session's heading: the other hand of the same visit, and sessions that have the same recording. */
import { h } from "../dom.js";
import { day, dayAndTime, t } from "../words/words.js";

export function mount(root, api, { session: { other_hand: other, same_recording: same } }) {
  const hand = other && h("a", { href: `/sessions/${other.session}` }, t(`session.other_hand.${other.hand}`));
  const before = same.map(({ session, started, added }) =>
    h(
      "p",
      { class: "warning" },
      t("session.same_recording", { added: dayAndTime(added) }),
      " ",
      h("a", { href: `/sessions/${session}` }, t("session.heading", { day: day(started) })),
    ),
  );
  root.append(...[hand, ...before].filter(Boolean));
  return () => {};
}
