/** The patient's own screen: the code first, then the hand with what to do, until the session is over. */
import { h } from "../dom.js";
import "../theme.js";
import { language } from "../words/languages.js";
import { t } from "../words/words.js";
import * as codeForm from "./code_form.js";
import { follow } from "./following.js";
import * as guide from "./guide.js";

const root = h("main", { id: "main" });
document.title = `${t("screen.title")} · Handscope`;
document.body.append(root);
let leave = () => {};

function show(part, about) {
  leave();
  root.replaceChildren();
  leave = part.mount(root, about);
}

function askCode(refusal = "") {
  show(codeForm, { open, refusal });
}

/** Open the screen with a code; gives the sentence where it was refused. */
async function open(code) {
  let response;
  try {
    response = await fetch("/api/patient-view", {
      method: "POST",
      headers: { "Content-Type": "application/json", "Accept-Language": language },
      body: JSON.stringify({ code }),
    });
  } catch {
    return t("error.unreachable");
  }
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) return answer.error ?? t("error.unreadable");
  if (answer.language !== language) location.replace(`/patient-view?language=${answer.language}`);
  else begin();
  return "";
}

function begin() {
  show(guide, { screen: follow({ refused: () => askCode(), over: () => askCode(t("screen.over")) }) });
}

/** Open with the code of the address, where it has one: of a link that was followed here, too. */
function openFromAddress() {
  const given = decodeURIComponent(location.hash.slice(1));
  if (!given) return false;
  history.replaceState(null, "", location.pathname + location.search); // a code is of no use in the history
  open(given).then((refusal) => refusal && askCode(refusal));
  return true;
}

addEventListener("hashchange", openFromAddress);
if (!openFromAddress()) begin();
