/** Gloves: which can be reached now and how those in use are, and which measured here before. */
import { h } from "../dom.js";
import { errorBox } from "../forms.js";
import { isCharge } from "../station/glove.js";
import { deviceWords, stripWords } from "../words/clinical.js";
import { counted, dayAndTime, decimal, t, whole } from "../words/words.js";

const AGAIN = 5000; // ms between two looks
const COLUMNS = ["glove.strip", "devices.sensors", "glove.rate", "glove.lost"];

export function mount(root, api, { title }) {
  title(t("devices.title"));
  const box = errorBox();
  const reachable = h("div", { class: "stack" });
  const earlier = h("div", { class: "stack" });
  root.append(
    h("div", { class: "head" }, h("div", {}, h("h1", {}, t("devices.title")), h("p", { class: "soft" }, t("devices.lead")))),
    box.element,
    h("div", { class: "stack" }, part("devices.reachable", reachable), part("devices.known", earlier)),
  );
  let gone = false;
  let timer = 0;
  let before = "";

  async function look() {
    try {
      const found = await api.get("/api/devices");
      if (gone) return;
      box.clear();
      const now = JSON.stringify(found);
      if (now !== before) draw(found);
      before = now;
    } catch (error) {
      if (gone) return;
      box.show(error);
    }
    timer = setTimeout(look, AGAIN);
  }

  function draw(found) {
    reachable.replaceChildren(...(found.reachable.length ? found.reachable.map(port) : [h("p", { class: "soft" }, t("devices.none"))]));
    earlier.replaceChildren(...(found.known.length ? found.known.map(worn) : [h("p", { class: "soft" }, t("devices.none_known"))]));
  }

  look();
  return () => {
    gone = true;
    clearTimeout(timer);
  };
}

const part = (words, gloves) => h("section", {}, h("h2", {}, t(words)), gloves);

/** A port, and its glove while a session uses it: only then it says how it is. */
function port({ path, description, in_use: used, live }) {
  const battery = live && (isCharge(live.battery) ? `${live.battery} %` : t("devices.battery_none"));
  const state = live ? t(live.flowing ? "devices.sending" : "glove.silent") : t(used ? "devices.in_use" : "devices.idle");
  return h(
    "section",
    { class: "card", "data-port": path },
    h("h3", {}, description, " ", h("span", { class: live?.flowing ? "badge good" : "badge" }, state)),
    h("p", { class: "soft small" }, path),
    live?.problem && h("p", { class: "warning" }, live.problem),
    live && facts([["devices.name", live.name], ["devices.firmware", live.firmware], ["devices.battery", battery]]),
    live && table(live.strips),
  );
}

function worn(glove) {
  const calibrated = glove.calibrated && counted("devices.calibrated", glove.calibrated_sensors, { when: dayAndTime(glove.calibrated) });
  const last = h("a", { href: `/sessions/${glove.session}` }, `${dayAndTime(glove.started)}, ${t(`hand.${glove.hand}.title`)}`);
  return h(
    "section",
    { class: "card", "data-glove": glove.device_id || glove.name },
    h("h3", {}, glove.name ? deviceWords(glove.name) : t("devices.unnamed")),
    facts([
      ["devices.number", glove.device_id],
      ["devices.firmware", glove.firmware],
      ["devices.last", last],
      ["devices.sessions", counted("sessions", glove.sessions)],
      ["devices.calibration", calibrated || t("devices.calibration_none")],
    ]),
    table(glove.streams),
  );
}

function facts(rows) {
  return h("dl", { class: "facts" }, rows.map(([word, value]) => [h("dt", {}, t(word)), h("dd", {}, value || t("devices.unknown"))]));
}

/** A strip a row: sensors, rate, samples lost and their share. */
function table(strips) {
  const row = ({ name, sensors, rate, samples, lost }) => {
    const share = lost && samples ? ` (${decimal((100 * lost) / (samples + lost), 2)} %)` : "";
    const gone = lost === null ? t("devices.unknown") : whole(lost) + share;
    const cells = [whole(sensors), t("unit.per_second_of", { rate: Math.round(rate) }), gone];
    return h("tr", {}, h("th", { scope: "row" }, stripWords(name)), cells.map((cell) => h("td", { class: "number" }, cell)));
  };
  const head = h("tr", {}, COLUMNS.map((word) => h("th", { scope: "col" }, t(word))));
  const lines = h("table", { class: "compact" }, h("thead", {}, head), h("tbody", {}, strips.map(row)));
  return h("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("recording.streams") }, lines);
}
