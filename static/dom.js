/** Elements without markup from text: h("p", { class: "hint", onclick }, "text", child, [more]). */
import { afterPress } from "./presses.js";
import { isSame } from "./same.js";

const SVG = "http://www.w3.org/2000/svg"; // a name, not an address
const PROPERTIES = new Set(["value", "checked", "disabled", "selected", "hidden", "indeterminate"]);

export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (PROPERTIES.has(name)) element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  return element;
}

/** A drawing of the bundled set (style.css); what it means stands in words beside it. */
export function icon(name) {
  return h("span", { class: `icon icon-${name}`, "aria-hidden": "true" });
}

/** The same for drawings: s("svg", { viewBox }, s("path", { d })). */
export function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children.flat(Infinity));
  return element;
}

/** The text of an element; one that stands there already is not laid out anew. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Hides an element or shows it; one that is so already is not styled anew. */
export function hide(element, hidden) {
  if (element.hidden !== hidden) element.hidden = hidden;
}

/** Draws again only when what `select` picks is another than before: what a person is about to press, or presses, stays in place. */
export function whenChanged(select, draw) {
  let before = Symbol("nothing yet");
  let newest;
  const drawNewest = () => {
    const picked = select(newest);
    if (isSame(before, picked)) return;
    before = picked;
    draw(picked);
  };
  return (value) => {
    newest = value;
    afterPress(drawNewest);
  };
}

/** A function that is called at once, and then at most every `pause` ms with the newest arguments. */
export function paced(pause, act) {
  let timer = 0;
  let waiting = null;
  const later = () => {
    timer = 0;
    if (waiting) run(waiting);
  };
  const run = (given) => {
    waiting = null;
    timer = setTimeout(later, pause);
    act(...given);
  };
  return (...given) => (timer ? (waiting = given) : run(given));
}

/** Tells whether something has been so for `least` ms, from being asked again and again: a moment's hitch is no alarm. */
export function lasting(least) {
  let since = null;
  return (is) => {
    if (!is) since = null;
    else since ??= performance.now();
    return is && performance.now() - since >= least;
  };
}

/** Mounts parts, each { mount } into a root of its own; gives back how to unmount all of them. */
export function assemble(api, about, parts) {
  const leave = parts.map(([part, root]) => part.mount(root, api, about));
  return () => leave.forEach((unmount) => unmount());
}
