/** The glove of this session at a browser's port: shown where there is something to know of it. */
import { h } from "../dom.js";
import * as notice from "../relay/notice.js";

export function mount(root, api, { station }) {
  const { session, relayed } = station.latest;
  if (!relayed) return () => {};
  const place = h("div", {});
  root.append(place);
  return notice.mount(place, session, true);
}
