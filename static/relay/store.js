/** What the port gave and the server does not have yet, in the browser's own file system: it outlives reloads. For workers only.
 *
 * Two files in turn, each a row of records: number u64, time f64 (ms), size u32, bytes.
 * The newest record grows with every read; its size is OPEN until it is sealed. */
const HEAD = 20;
const OPEN = 0xffffffff;
const LONGEST = 32768; // bytes of a record from which it is sealed
const TURN = 8 << 20; // bytes of a file from which the other one is taken, where nothing in that waits any more
const MOST = 1 << 30; // bytes that are kept; then the port is not read

/** Open the store of a session; fails while another page of this browser has it. */
export async function openStore(session) {
  const folder = await navigator.storage.getDirectory();
  const names = ["a", "b"].map((letter) => `relay-${session}-${letter}`);
  const files = [];
  try {
    for (const name of names) {
      const file = await folder.getFileHandle(name, { create: true });
      files.push(await /** @type {any} */ (file).createSyncAccessHandle());
    }
  } catch (error) {
    files.forEach((file) => file.close());
    throw error;
  }
  return kept(files, async () => {
    files.forEach((file) => file.close());
    for (const name of names) await folder.removeEntry(name);
  });
}

function kept(files, remove) {
  const waiting = files.flatMap(records).sort((one, other) => one.number - other.number);
  let next = waiting.length ? waiting.at(-1).number + 1 : 0;
  let active = files[1].getSize() > 0 && waiting.at(-1)?.file === files[1] ? 1 : 0;
  let open = null;

  /** Bytes of the port, on their way to the disk when this returns. */
  function put(bytes, time) {
    const file = files[active];
    if (!open) {
      open = { number: next, time, file, at: file.getSize(), size: 0 };
      file.write(head(next, time, OPEN), { at: open.at });
      next += 1;
    }
    file.write(bytes, { at: open.at + HEAD + open.size });
    open.size += bytes.length;
    if (open.size >= LONGEST) seal();
  }

  /** The newest record is whole: it can be sent. */
  function seal() {
    if (!open) return;
    open.file.write(head(open.number, open.time, open.size), { at: open.at });
    waiting.push(open);
    open = null;
    turn();
  }

  function turn() {
    const other = 1 - active;
    const used = waiting.some((record) => record.file === files[other]);
    if (!used && files[other].getSize()) files[other].truncate(0);
    if (!used && files[active].getSize() >= TURN) active = other;
  }

  return {
    put,
    seal,
    waiting,
    flush: () => files[active].flush(),
    remove,
    get next() {
      return next;
    },
    get full() {
      return files[0].getSize() + files[1].getSize() >= MOST;
    },
    /** Nothing before this number is needed any more. */
    forget(number) {
      const first = waiting.findIndex((record) => record.number >= number);
      waiting.splice(0, first < 0 ? waiting.length : first);
      if (!open) next = Math.max(next, number);
    },
    /** The web socket message of a record. */
    message({ number, time, file, at, size }) {
      const bytes = new Uint8Array(16 + size);
      const view = new DataView(bytes.buffer);
      view.setBigUint64(0, BigInt(number), true);
      view.setFloat64(8, time, true);
      file.read(bytes.subarray(16), { at: at + HEAD });
      return bytes;
    },
  };
}

function head(number, time, size) {
  const view = new DataView(new ArrayBuffer(HEAD));
  view.setBigUint64(0, BigInt(number), true);
  view.setFloat64(8, time, true);
  view.setUint32(16, size, true);
  return view;
}

/** The records of a file; one that was growing when its page ended is sealed as it is. */
function records(file) {
  const found = [];
  const end = file.getSize();
  let at = 0;
  while (at + HEAD < end) {
    const view = new DataView(new ArrayBuffer(HEAD));
    file.read(view, { at });
    const stated = view.getUint32(16, true);
    const size = stated === OPEN ? Math.min(end - at - HEAD, 2 * LONGEST) : stated;
    const [number, time] = [Number(view.getBigUint64(0, true)), view.getFloat64(8, true)];
    if (at + HEAD + size > end) break;
    if (stated === OPEN) file.write(head(number, time, size), { at });
    found.push({ number, time, file, at, size });
    at += HEAD + size;
  }
  file.truncate(at);
  return found;
}
