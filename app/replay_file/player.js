/** Plays the movement beside it on the hand in the frame: unpacks both, and tells viser's page how every bone is turned and where it is. */
const payload = JSON.parse(document.getElementById("payload").textContent);
const [scene, play, where, clock, speed, chapters] = ["scene", "play", "where", "clock", "speed", "chapters"].map((id) => document.getElementById(id));
const [first, last] = [payload.t[0], payload.t.at(-1)];
let [at, playing, columns, before] = [first, false, null, 0];

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
}

/** Sums of the steps: column after column, wrapping round as 16 bits do. */
async function movement() {
  const steps = new Int16Array(await (await unpacked("movement")).arrayBuffer());
  const count = payload.t.length;
  for (let k = 0; k < steps.length; k++) if (k % count) steps[k] += steps[k - 1];
  return steps;
}

/** `size` numbers from column `from` on at the picture `k` and the share of the way to the next. */
function numbers(from, size, k, share, scale) {
  const count = payload.t.length;
  const next = Math.min(k + 1, count - 1);
  const read = (column, row) => columns[column * count + row];
  const [a, b] = [k, next].map((row) => Array.from({ length: size }, (_, c) => read(from + c, row)));
  const same = size !== 4 || a.reduce((sum, value, c) => sum + value * b[c], 0) >= 0 ? 1 : -1;
  const mixed = a.map((value, c) => scale * (value + share * (same * b[c] - value)));
  const length = size === 4 ? Math.hypot(...mixed) || 1 : 1;
  return mixed.map((value) => value / length);
}

function draw() {
  const page = scene.contentWindow.__viserMutable;
  if (!page || !columns) return;
  let [low, high] = [0, payload.t.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    payload.t[middle] <= at ? (low = middle) : (high = middle);
  }
  const share = Math.min(Math.max((at - payload.t[low]) / Math.max(payload.t[high] - payload.t[low], 1e-6), 0), 1);
  const turns = Array.from({ length: payload.bones }, (_, k) => numbers(4 + 4 * k, 4, low, share, 1 / payload.full));
  const places = Array.from({ length: payload.bones }, (_, k) => numbers(4 + 4 * payload.bones + 3 * k, 3, low, share, payload.reach));
  page.messageQueue.push({ type: "SetOrientationMessage", name: "/hand", wxyz: numbers(0, 4, low, share, 1 / payload.full) });
  for (const [name, all] of Object.entries(payload.parts))
    all.forEach((bone, k) => {
      page.messageQueue.push({ type: "SetBoneOrientationMessage", name, bone_index: k, wxyz: turns[bone] });
      page.messageQueue.push({ type: "SetBonePositionMessage", name, bone_index: k, position: places[bone] });
    });
  page.requestRender();
}

function show() {
  where.value = at;
  const words = payload.words.where.replace("{now}", at.toFixed(1)).replace("{all}", last.toFixed(1));
  clock.textContent = words;
  where.setAttribute("aria-valuetext", words);
  play.textContent = playing ? payload.words.pause : payload.words.play;
  [...chapters.children].forEach((button, k) => {
    const { start, stop } = payload.chapters[k];
    button.toggleAttribute("aria-current", at >= start && at < stop);
  });
  draw();
}

function seek(moment) {
  at = Math.min(Math.max(moment, first), last);
  show();
}

function toggle() {
  playing = !playing;
  if (playing && at >= last) at = first;
  before = performance.now();
  show();
  if (playing) requestAnimationFrame(step);
}

function step(now) {
  if (!playing) return;
  at = Math.min(at + (Number(speed.value) * (now - before)) / 1000, last);
  before = now;
  playing = at < last;
  show();
  if (playing) requestAnimationFrame(step);
}

function pressed(event) {
  if (event.target.closest?.("select") || event.ctrlKey || event.metaKey || event.altKey) return;
  const keys = { ArrowLeft: () => seek(at - 1), ArrowRight: () => seek(at + 1), Home: () => seek(first), End: () => seek(last) };
  const act = event.key === " " && event.target.tagName !== "BUTTON" ? toggle : keys[event.key];
  if (act) (event.preventDefault(), act());
}

async function begin() {
  scene.title = payload.words.scene;
  where.max = last;
  where.setAttribute("aria-label", payload.words.where.replace(/ ?\{\w+\} ?/g, " ").trim());
  speed.setAttribute("aria-label", payload.words.speed);
  [0.25, 0.5, 1, 2, 4].forEach((value) => speed.append(new Option(`${value} ×`, value, value === 1, value === 1)));
  payload.chapters.forEach(({ title, start }) => {
    const button = document.createElement("button");
    button.textContent = title;
    button.onclick = () => seek(start);
    chapters.append(button);
  });
  play.onclick = toggle;
  where.oninput = () => seek(Number(where.value));
  document.addEventListener("keydown", pressed);
  try {
    columns = await movement();
    scene.srcdoc = await (await unpacked("packed-scene")).text();
  } catch {
    document.querySelector("header p").textContent = payload.words.impossible;
  }
  const wait = setInterval(() => {
    const page = scene.contentWindow.__viserMutable;
    if (!page || Object.keys(page.skinnedMeshState).length < Object.keys(payload.parts).length) return;
    clearInterval(wait);
    scene.contentWindow.document.addEventListener("keydown", pressed);
    setTimeout(draw, 300);
    document.documentElement.dataset.ready = "yes";
  }, 100);
  show();
}

begin();
