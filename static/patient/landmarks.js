/** The photograph with its landmarks, to be dragged to their places: by pointer, or by the arrow keys. */
import { h, s } from "../dom.js";
import { wholeJoint } from "../words/clinical.js";
import { t } from "../words/words.js";

const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const CHAINS = {
  thumb: ["thumb_cmc", "thumb_mcp", "thumb_ip", "thumb_tip"],
  ...Object.fromEntries(["index", "middle", "ring", "little"].map((f) => [f, ["mcp", "pip", "dip", "tip"].map((j) => `${f}_${j}`)])),
  wrist: ["wrist_radial", "wrist_ulnar"],
  forearm: ["forearm_radial", "forearm_ulnar"],
};

const REACH = 22; // px from where it is pressed to the point that is taken
const HIGH = 74; // % of the window at most
const ROOM = 0.2; // of the hand's size, round it

/** Resolves with the places by name, pixels, in picture `number` of `many`; null where the person gave up. */
export function correctLandmarks(root, file, { size, landmarks }, number = 1, many = 1) {
  const address = URL.createObjectURL(file);
  const places = structuredClone(landmarks);
  const now = h("p", { class: "soft", role: "status" }, t("landmarks.how"));
  const lines = Object.values(CHAINS).map((names) => [names, s("polyline", { class: "chain" })]);
  const seen = around(places, size);
  const radius = Math.max(...seen.slice(2)) / 160;
  const points = Object.keys(places).map(point);
  const image = s("image", { href: address, width: size[0], height: size[1] });
  const drawing = s(
    "svg",
    { viewBox: seen.join(" "), class: "landmarks" },
    image,
    lines.map(([, line]) => line),
    points,
  );
  drawing.style.width = `min(98vw - 2.25rem, ${(HIGH * seen[2]) / seen[3]}vh)`;
  const close = (value) => {
    URL.revokeObjectURL(address);
    dialog.remove();
    finish(value);
  };
  let finish;
  const next = t(number < many ? "landmarks.next" : "landmarks.measure");
  const done = h("button", { type: "button", class: "primary large", onclick: () => close(places) }, next);
  const stop = h("button", { type: "button", onclick: () => close(null) }, t("cancel"));
  const title = many > 1 ? t("landmarks.title_of", { number, many }) : t("landmarks.title");
  const dialog = h(
    "dialog",
    { class: "photograph", "aria-label": title },
    h("h2", {}, title),
    now,
    drawing,
    h("div", { class: "buttons" }, done, stop),
  );
  dialog.addEventListener("cancel", () => close(null));
  drawing.addEventListener("pointerdown", (event) => {
    const [x, y] = placeOf(event);
    const away = (dot) => Math.hypot(dot.getAttribute("cx") - x, dot.getAttribute("cy") - y);
    const nearest = points.reduce((a, b) => (away(b) < away(a) ? b : a));
    if (away(nearest) * drawing.getScreenCTM().a > REACH) return;
    event.preventDefault();
    nearest.focus();
    nearest.setPointerCapture(event.pointerId);
  });
  draw();
  root.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => (finish = resolve));

  function placeOf({ clientX, clientY }) {
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(drawing.getScreenCTM().inverse());
    return [x, y];
  }

  function draw() {
    for (const [names, line] of lines) line.setAttribute("points", names.map((name) => places[name].join()).join(" "));
  }

  function point(name) {
    const dot = s("circle", {
      class: "landmark",
      r: radius,
      tabindex: 0,
      role: "button",
      "aria-label": words(name),
      "data-landmark": name,
    });
    const put = (x, y) => {
      places[name] = [x, y];
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", y);
      draw();
    };
    dot.setAttribute("cx", places[name][0]);
    dot.setAttribute("cy", places[name][1]);
    dot.addEventListener("focus", () => (now.textContent = words(name)));
    dot.addEventListener("pointermove", (event) => dot.hasPointerCapture(event.pointerId) && put(...placeOf(event)));
    dot.addEventListener("keydown", (event) => {
      const step = KEYS[event.key];
      if (!step) return;
      event.preventDefault();
      const far = event.shiftKey ? 10 : 1;
      put(places[name][0] + far * step[0], places[name][1] + far * step[1]);
    });
    return dot;
  }
}

/** The part of a photograph that the hand takes, with room to move its points: left, top, width and height in pixels. */
function around(places, size) {
  const ends = size.map((most, k) => {
    const all = Object.values(places).map((place) => place[k]);
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const room = ROOM * (high - low) + 0.05 * Math.max(...size);
    return [Math.max(0, low - room), Math.min(most, high + room)];
  });
  return [...ends.map(([low]) => low), ...ends.map(([low, high]) => high - low)];
}

function words(name) {
  const [part, piece] = name.split(/_(?=[^_]*$)/);
  if (piece === "tip") return t("landmarks.tip", { finger: t(`finger.${part}`) });
  if (part === "wrist" || part === "forearm") return t(`landmarks.${name}`);
  return wholeJoint(name);
}
