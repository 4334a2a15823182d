/** What the server sends to the patient's screen, as it happens; the connection is made again whenever it is lost. */
const REFUSED = 4401;
const OVER = 1001;
const FIRST = 300; // ms until the first new try
const MOST = 5000;

/** Hear with on("state" | "line", listener); `refused` and `over` are called when the screen may show nothing more. */
export function follow({ refused, over }) {
  const listeners = { state: new Set(), line: new Set() };
  const tell = (what, value) => listeners[what].forEach((listener) => listener(value));
  let socket = null;
  let latest = null;
  let left = false;
  let wait = FIRST;
  let timer = 0;

  function open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    socket = new WebSocket(`${scheme}://${location.host}/api/patient-view/live`);
    socket.onmessage = ({ data }) => {
      wait = FIRST;
      latest = JSON.parse(data);
      tell("line", true);
      tell("state", latest);
    };
    socket.onclose = ({ code }) => {
      if (left) return;
      if (code === REFUSED) refused();
      else if (code === OVER) over();
      else again();
    };
  }

  function again() {
    tell("line", false);
    timer = setTimeout(open, wait);
    wait = Math.min(2 * wait, MOST);
  }

  open();
  return {
    on(what, listener) {
      listeners[what].add(listener);
      if (what === "state" && latest) listener(latest);
      return () => listeners[what].delete(listener);
    },
    leave() {
      left = true;
      clearTimeout(timer);
      socket?.close();
    },
  };
}
