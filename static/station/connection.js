/** What a station tells, as it happens, and what a person wants of it. The connection is made again whenever it is lost. */
import { sharing, withChanges } from "../same.js";
import { language } from "../words/languages.js";

const FIRST = 300; // ms until the first new try
const MOST = 5000;
const RATE = 20; // messages a second of a live session: each takes a part of the time that the scene has for a picture

/** Hear with on("full" | "pulse" | "line" | "ended", listener); `line` is true while the connection stands. */
export function follow(name, api) {
  const listeners = { full: new Set(), pulse: new Set(), line: new Set(), ended: new Set() };
  const tell = (what, value) => listeners[what].forEach((listener) => listener(value));
  let socket = null;
  let latest = null;
  let newest = null;
  let streamed = null; // the whole as the web socket had it last: what an action answers is not in its order
  let left = false;
  let wait = FIRST;
  let timer = 0;

  /** What did not change stays the same object, so that the thirty parts of the page need not look into it. */
  function take(full) {
    latest = sharing(latest, full);
    tell("full", latest);
  }

  function open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const rate = latest.replay ? "" : `&rate=${RATE}`; // a replay's cursor moves with every message
    socket = new WebSocket(`${scheme}://${location.host}/api/stations/${name}/live?language=${language}${rate}&changes=true`);
    socket.onopen = () => {
      wait = FIRST;
      tell("line", true);
    };
    socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      if (message.full || message.changes) take((streamed = message.full ?? withChanges(streamed, message.changes)));
      newest = message.pulse;
      tell("pulse", newest);
    };
    socket.onclose = () => left || (latest?.ended ? tell("ended", latest) : reconnect());
  }

  /** Ask first whether the station is still there: a web socket does not say why it was refused. */
  function reconnect() {
    tell("line", false);
    timer = setTimeout(async () => {
      wait = Math.min(2 * wait, MOST);
      try {
        take(await api.get(`/api/stations/${name}`));
        if (!left) open();
      } catch (error) {
        if (left) return;
        error.status === 404 ? tell("ended", latest) : reconnect();
      }
    }, wait);
  }

  return {
    name,
    get latest() {
      return latest;
    },
    on(what, listener) {
      listeners[what].add(listener);
      const known = { full: latest, pulse: newest }[what];
      if (known) listener(known); // who comes late must not wait for the next change: a paused replay tells nothing
      return () => listeners[what].delete(listener);
    },
    async begin() {
      take(await api.get(`/api/stations/${name}`));
      open();
    },
    async act(action, more = {}) {
      take(await api.post(`/api/stations/${name}/actions`, { action, ...more }));
    },
    /** Do `work`, which ends the station and leads on by itself; where it fails, an end that came meanwhile is told. */
    async endFor(work) {
      left = true;
      try {
        return await work();
      } catch (error) {
        left = false;
        if (socket?.readyState === WebSocket.CLOSED) reconnect();
        throw error;
      }
    },
    end: () => api.remove(`/api/stations/${name}`),
    leave() {
      left = true;
      clearTimeout(timer);
      socket?.close();
    },
  };
}
