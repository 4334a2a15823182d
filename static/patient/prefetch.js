/** What a station loads first, fetched while its session is being prepared: its modules, and the page of the 3-D scene. */
import { h } from "../dom.js";

let asked = false;

/** Once, and not where the browser is to save data. */
export async function prefetchStation() {
  // @ts-expect-error: not every browser has it
  if (asked || navigator.connection?.saveData) return;
  asked = true;
  await Promise.all([import("../pages/station.js"), import("../station/live.js")]);
  // a frame that runs no script: what <link rel="prefetch"> or fetch brings, browsers keep apart from what frames show
  const scene = h("iframe", { src: "/scene/", sandbox: "allow-same-origin", hidden: true, onload: () => scene.remove() });
  document.body.append(scene);
}
