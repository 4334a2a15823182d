/** A patient or session as the page holds it; a change names the version that was seen: another window's is never overwritten unseen. */
import { h } from "../dom.js";
import { factWords } from "./fact_fields.js";
import { merged, same } from "./merging.js";
import { known, t } from "../words/words.js";

export function makeRecord(api, first, kind = "patients") {
  const listeners = new Set();
  const address = `/api/${kind}/${first.id}`;
  let seen = first;
  const take = (now) => {
    seen = { ...seen, ...now };
    listeners.forEach((listener) => listener(seen));
  };
  return {
    get now() {
      return seen;
    },
    /** Hear of every change; gives back how to stop that. */
    watch: (listener) => {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    change: async (facts, version) => take(await api.patch(address, { version, ...facts })),
    stored: () => api.get(address),
    reload: async () => take(await api.get(address)),
  };
}

/**
 * Send a change of the record as it was when the person began, `seen`. Where somebody else was faster, both changes are kept; where both
 * changed the same fact, what is stored now is shown beside what was typed and the person chooses. True when it is saved; what was chosen
 * goes to `takeStored`, with true where it is the person's own.
 */
export async function sendChange(record, facts, box, takeStored, seen = record.now) {
  try {
    await record.change(facts, seen.version);
    return true;
  } catch (error) {
    const stored = error.status === 409 && (await record.stored().catch(() => null));
    if (!stored) throw error;
    const clashes = [];
    const both = merged(pick(seen, facts), pick(stored, facts), facts, (name) => clashes.push(name));
    await record.reload();
    if (!clashes.length) return sendChange(record, both, box, takeStored);
    const mine = async () => {
      box.clear();
      const send = sendChange(record, both, box, takeStored).then((done) => done && takeStored(record.now, true));
      await send.catch((again) => box.show(again));
    };
    const theirs = () => {
      box.clear();
      takeStored(record.now);
    };
    box.show(error, differences(both, stored), choice(mine, theirs));
    return false;
  }
}

const pick = (of, facts) => Object.fromEntries(Object.keys(facts).map((name) => [name, of[name]]));

function differences(facts, stored) {
  const other = Object.keys(facts).filter((name) => name in stored && !same(facts[name], stored[name]));
  const rows = other.map((name) => {
    const words = (value) => (typeof value === "object" && value ? t("conflict.other_values") : factWords(name, value));
    return h("li", {}, t("conflict.row", { fact: known(`fact.${name}`, name), stored: words(stored[name]), mine: words(facts[name]) }));
  });
  return rows.length ? h("ul", {}, rows) : h("p", {}, t("conflict.same"));
}

function choice(mine, theirs) {
  return h(
    "div",
    { class: "buttons" },
    h("button", { type: "button", onclick: theirs }, t("conflict.theirs")),
    h("button", { type: "button", onclick: mine }, t("conflict.mine")),
  );
}
