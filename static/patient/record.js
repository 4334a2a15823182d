/** A patient as the page holds it; a change names the version that was seen, so that another window's is never overwritten unseen. */
import { h } from "../dom.js";
import { factWords } from "./fact_fields.js";
import { merged, same } from "./merging.js";
import { known, t } from "../words/words.js";

export function makeRecord(api, patient) {
  const listeners = new Set();
  let seen = patient;
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
    change: async (facts, version) => take(await api.patch(`/api/patients/${seen.id}`, { version, ...facts })),
    reload: async () => take(await api.get(`/api/patients/${seen.id}`)),
  };
}

/**
 * Send a change of the patient as it was when the person began, `seen`. Where somebody else was faster, both changes are kept; where both
 * changed the same fact, what is stored now is shown beside what was typed and the person chooses. True when it is saved.
 */
export async function sendChange(record, api, facts, box, takeStored, seen = record.now) {
  try {
    await record.change(facts, seen.version);
    return true;
  } catch (error) {
    const stored = error.status === 409 && (await api.get(`/api/patients/${seen.id}`).catch(() => null));
    if (!stored) throw error;
    const clashes = [];
    const both = merged(pick(seen, facts), pick(stored, facts), facts, (name) => clashes.push(name));
    await record.reload();
    if (!clashes.length) return sendChange(record, api, both, box, takeStored);
    const mine = async () => {
      box.clear();
      await sendChange(record, api, both, box, takeStored).catch((again) => box.show(again));
    };
    const theirs = () => {
      box.clear();
      takeStored(record.now);
    };
    box.show(error, differences(both, stored), choice(mine, theirs));
    return false;
  }
}

const pick = (patient, facts) => Object.fromEntries(Object.keys(facts).map((name) => [name, patient[name]]));

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
