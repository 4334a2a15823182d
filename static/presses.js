/** While a person presses a button its place is not drawn anew: one that was replaced meanwhile would do nothing. */

const PRESSED = "button, a, summary, label";
const CLICK = 50; // ms after letting go, when its click has come
const LONGEST = 3000; // ms: the page goes on, even where nobody hears of the end of a press
const waiting = new Set();
let timer = 0;

addEventListener("pointerdown", begin, true);
for (const end of ["pointerup", "pointercancel", "contextmenu"]) addEventListener(end, () => timer && letGoIn(CLICK), true);

function begin({ button, target }) {
  if (button === 0 && target.closest(PRESSED)) letGoIn(LONGEST);
}

function letGoIn(time) {
  clearTimeout(timer);
  timer = setTimeout(letGo, time);
}

function letGo() {
  timer = 0;
  const drawings = [...waiting];
  waiting.clear();
  drawings.forEach((draw) => draw());
}

/** Call `draw` now or, once, when what is pressed has been let go. */
export function afterPress(draw) {
  timer ? waiting.add(draw) : draw();
}
