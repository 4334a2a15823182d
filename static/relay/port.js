/** The glove's port in a worker: opened again whenever it went away. */
const BAUD = 115200; // ignored by USB
const BUFFER = 1 << 20; // bytes that the browser holds for us
const RETRY_MS = 500;

/** `take` gets the bytes, `change` "open", "away" or "missing"; while `full()` nothing is read. */
export function readPort(usbIds, { take, full, change }) {
  let port = null;
  let reader = null;
  let writer = null;
  let stopped = false;
  const pause = () => new Promise((resolve) => setTimeout(resolve, RETRY_MS));

  async function run() {
    while (!stopped) {
      port = await find(usbIds);
      if (!port) change("missing");
      else await read().catch(() => null);
      if (!stopped) await pause();
    }
  }

  async function read() {
    try {
      await port.open({ baudRate: BAUD, bufferSize: BUFFER });
      reader = port.readable.getReader();
      writer = port.writable.getWriter();
      change("open");
      for (;;) {
        while (full()) await pause();
        const { value, done } = await reader.read();
        if (done) return;
        take(value);
      }
    } finally {
      reader?.releaseLock();
      writer?.releaseLock();
      reader = writer = null;
      await port.close().catch(() => null);
      change("away");
    }
  }

  const ended = run();
  return {
    /** Commands for the glove; for a port that is away they are dropped: the server asks again when it is open. */
    write: (bytes) => writer?.write(bytes).catch(() => null),
    async stop() {
      stopped = true;
      await reader?.cancel().catch(() => null);
      await ended;
    },
  };
}

/** The port that a person chose, among those that this browser may open. */
async function find({ usbVendorId, usbProductId }) {
  const ports = await /** @type {any} */ (navigator).serial.getPorts();
  return ports.find((port) => {
    const info = port.getInfo();
    return info.usbVendorId === usbVendorId && info.usbProductId === usbProductId;
  });
}
