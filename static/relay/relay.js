/** The glove at this browser's own port: chosen by a person, read by a worker that goes on from page to page and after a reload. */
import { t } from "../words/words.js";

export const PORT = "relay://"; // of this browser
const KEY = "handscope-relay"; // session and device, until the server has everything
const serial = () => /** @type {any} */ (navigator).serial;
const listeners = new Set();
let worker = null;
let latest = null;

/** Why this browser cannot read a port: "insecure", "missing", or "" where it can. */
export const reason = () => (!isSecureContext ? "insecure" : serial() ? "" : "missing");

/** As one of the gloves to choose from: it may be at the computer that shows this page. */
export function option() {
  const why = reason();
  return { value: PORT, label: t("relay.port"), note: t(why ? `relay.${why}` : "relay.port.note"), disabled: Boolean(why) };
}

/** Have a person choose a port; only within a click. Null where none was chosen. */
export async function choose() {
  try {
    return (await serial().requestPort()).getInfo();
  } catch (error) {
    if (error.name === "NotFoundError") return null;
    throw error;
  }
}

/** Read the port for a session from now on. */
export function begin(session, which) {
  localStorage.setItem(KEY, JSON.stringify({ session, which }));
  start(session, which);
}

/** Go on where a reload or another page interrupted it. */
export function resume() {
  const stored = JSON.parse(localStorage.getItem(KEY) ?? "null");
  if (stored && !worker) start(stored.session, stored.which);
}

/** Call `listener` with each report of the worker; null where nothing is read here. */
export function watch(listener) {
  listeners.add(listener);
  listener(latest);
  return () => listeners.delete(listener);
}

function start(session, which) {
  worker?.terminate();
  worker = new Worker("/static/relay/worker.js", { type: "module" });
  worker.onmessage = ({ data }) => {
    if (data.done) finish();
    tell({ session, ...data });
  };
  worker.postMessage({ session, which });
  tell({ session, port: "away", line: false, login: true, kept: 0 });
}

function finish() {
  localStorage.removeItem(KEY);
  worker?.terminate();
  worker = null;
}

function tell(report) {
  latest = report;
  listeners.forEach((listener) => listener(report));
}
