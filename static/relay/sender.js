/** Sends what a store holds and forgets what the server has on its disk. */
const AHEAD = 4 << 20; // bytes on their way and not on the server's disk
const LAST = 300; // ms that the glove has for its last bytes when the session ends

export const now = () => performance.timeOrigin + performance.now();
export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** The messages of a store to the server, over one web socket after the other; `state` says how port, line and session are. */
export function makeSender(store, state) {
  let socket = null;
  let sent = 0; // number of the next message to send
  let stored = 0; // messages on the server's disk
  let ready = false;
  let finishing = false;

  function sayPort() {
    if (ready) socket.send(JSON.stringify({ is_open: state.port === "open" }));
  }

  function pump() {
    if (!ready) return;
    let ahead = store.waiting.reduce((sum, { number, size }) => sum + (number < sent ? size : 0), 0);
    for (const record of store.waiting) {
      if (record.number < sent) continue;
      if (ahead > AHEAD || socket.bufferedAmount > AHEAD) return;
      socket.send(store.message(record));
      sent = record.number + 1;
      ahead += record.size;
    }
    if (finishing) socket.send(JSON.stringify({ total: store.next }));
    finishing = false;
  }

  async function finish(port) {
    if (state.ending) return;
    state.ending = true;
    await pause(LAST);
    await port.stop();
    store.seal();
    finishing = true;
    pump();
  }

  const self = {
    port: null,
    served: false,
    pump,
    sayPort,
    /** Gives the code with which the connection ended. */
    connect: (token) =>
      new Promise((resolve) => {
        self.served = ready = false;
        socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/relay`);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => socket.send(JSON.stringify({ token, now: now() }));
        socket.onmessage = ({ data }) => (typeof data === "string" ? hear(JSON.parse(data)) : self.port.write(new Uint8Array(data)));
        socket.onclose = ({ code }) => {
          ready = state.line = false;
          resolve(code);
        };
      }),
  };

  function hear(words) {
    if (words.number !== undefined) {
      self.served = ready = state.line = true;
      sent = stored = words.number;
      store.forget(stored);
      finishing = state.ending;
      sayPort();
    }
    if (words.on_disk > stored) store.forget((stored = words.on_disk));
    if (words.ending) finish(self.port);
    pump();
  }

  return self;
}
