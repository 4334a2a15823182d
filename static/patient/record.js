/** A patient as the page holds it; a change names the version that was seen, so that another window's is never overwritten unseen. */
import { h } from "../dom.js";
import { factWords } from "./fact_fields.js";
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
    change: async (facts) => take(await api.patch(`/api/patients/${seen.id}`, { version: seen.version, ...facts })),
    reload: async () => take(await api.get(`/api/patients/${seen.id}`)),
  };
}

/** Send a change; where somebody else was faster, show what is stored now beside what was typed and let the person choose. */
export async function sendChange(record, api, facts, box, takeStored) {
  try {
    await record.change(facts);
    return true;
  } catch (error) {
    const stored = await api.get(`/api/patients/${record.now.id}`).catch(() => null);
    if (!stored || stored.version === record.now.version) throw error;
    const mine = async () => {
      box.clear();
      await record.reload();
      await sendChange(record, api, facts, box, takeStored).catch((again) => box.show(again));
    };
    const theirs = async () => {
      box.clear();
      await record.reload();
      takeStored(record.now);
    };
    box.show(error, differences(facts, stored), choice(mine, theirs));
    return false;
  }
}

function differences(facts, stored) {
  const other = Object.keys(facts).filter((name) => name in stored && JSON.stringify(facts[name]) !== JSON.stringify(stored[name]));
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
