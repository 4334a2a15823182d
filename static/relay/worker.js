/** Reads the glove at this browser's port and sends it to the server; what the server does not have on its disk is kept here. */
import { openStore } from "./store.js";
import { readPort } from "./port.js";
import { makeSender, now, pause } from "./sender.js";

const BEAT = 50; // ms of bytes in one message
const TELL = 500; // ms between two reports to the page
const AGAIN = 500; // ms until a lost connection is tried again, and more each time up to
const SELDOM = 5000;
const GONE = 30_000; // ms of being told that there is no such session until that is believed
const COMPLETE = 1000;

const state = { port: "away", line: false, login: true, ending: false, done: "", kept: 0, since: null };

onmessage = ({ data }) => begin(data).catch((error) => report({ done: "failed", why: String(error) }));

async function begin({ session, which }) {
  const store = await opened(session);
  const sender = makeSender(store, state);
  const port = readPort(which, {
    take: (bytes) => store.put(bytes, now()),
    full: () => store.full,
    change: (is) => {
      state.port = is;
      sender.sayPort();
    },
  });
  sender.port = port;
  let flushed = 0;
  const beat = setInterval(() => {
    store.seal();
    sender.pump();
    if (now() - flushed < TELL) return;
    flushed = now();
    store.flush();
    state.kept = store.waiting.reduce((sum, record) => sum + record.size, 0);
    state.since = store.waiting[0]?.time ?? null;
    report();
  }, BEAT);
  const end = await talk(session, sender);
  clearInterval(beat);
  port.stop();
  await store.remove();
  report({ done: end });
}

/** The session's store; another page of this browser may have it, or the page before this one for a moment. */
async function opened(session) {
  for (;;) {
    try {
      return await openStore(session);
    } catch (error) {
      if (error.name !== "NoModificationAllowedError") throw error;
      report({ port: "elsewhere" });
      await pause(AGAIN);
    }
  }
}

/** Connect again and again until all is on the server's disk, or until there is no such session. */
async function talk(session, sender) {
  let wait = AGAIN;
  let missing = null;
  for (;;) {
    const answer = await fetch(`/api/sessions/${session}/relays`, { method: "POST" }).catch(() => null);
    state.login = answer?.status !== 401;
    if (answer?.ok) {
      const code = await sender.connect((await answer.json()).token);
      if (code === COMPLETE) return "complete";
      if (sender.served) wait = AGAIN;
      missing = null;
    } else if (answer?.status === 404) {
      missing ??= now();
      if (now() - missing > GONE) return "gone";
    }
    await pause(wait);
    wait = Math.min(2 * wait, SELDOM);
  }
}

function report(more = {}) {
  postMessage({ ...state, ...more });
}
