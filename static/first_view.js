/** The first view, before its modules are there: whose account it is, and early answers to what the page at this address reads. */
import { READER } from "./words/languages.js";

/** Roles, and whether a second factor is still required; the server wrote it into the document. */
export const account = JSON.parse(document.documentElement.dataset.account);
/** Who sees the list of patients, and what each reads beside it; others would be refused. */
const BESIDE_LIST = { clinician: ["/api/sessions/unfinished"], scientist: [] };

/** @type {[RegExp, (id: string) => string[]][]} */
const DATA = [
  [/^\/$/, patientList],
  [/^\/patients\/(\d+)$/, (id) => [`/api/patients/${id}`]],
  [/^\/sessions\/(\d+)$/, (id) => [`/api/sessions/${id}`]],
  [/^\/stations\/([^/]+)$/, (id) => [`/api/stations/${id}`]],
];
/** @type {Map<string, Promise<Response>>} */
const early = new Map();

/** The answer to an address that was asked for early: once, and on the first view alone. */
export function takeEarly(path) {
  const answer = early.get(path);
  early.delete(path);
  return answer;
}

/** What nobody took is old when the next view asks for it. */
export const forgetEarly = () => early.clear();

/** Read whole at once: what nobody takes must not keep the connection. */
async function ask(path) {
  const answer = await fetch(path, { headers: READER });
  return new Response(await answer.blob(), answer);
}

function patientList() {
  const seen = account.roles.filter((role) => role in BESIDE_LIST);
  return seen.length ? ["/api/patients?search=&archived=false&offset=0&limit=50", ...seen.flatMap((role) => BESIDE_LIST[role])] : [];
}

for (const [address, paths] of account.lacks_second_factor ? [] : DATA) {
  const found = location.pathname.match(address);
  for (const path of found ? paths(found[1]) : []) {
    early.set(path, ask(path));
    early.get(path).catch(() => {}); // who takes it hears of it
  }
}
