"""viser's page as a browser gets it: its own controls hidden, the pages' theme, and the security policy that it is served with.

The page's first script unpacks the viewer's program and puts it into the page as a second script. The policy names scripts by a nonce, a new
one with each page that is sent; ours, which stands before viser's, gives it to the first script element that is made. So what viser packs and how is its
own affair: nothing here reads it. Limits: docs/security.md, "The 3-D scene's page".
"""

import hashlib
import re
import secrets
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import viser

from handscope.app.scene import ground, palette, stage
from handscope.app.scene.palette import Colour

_HEAD = """<title>Hand</title><style>
html, body { margin: 0; height: 100%; background: radial-gradient(ellipse at 50% 42%, #f7f8f9 0%, #e9edf0 62%, #dde2e7 100%); }
.dark body { background: radial-gradient(ellipse at 50% 42%, #2b3641 0%, #1b242d 62%, #131a21 100%); }
#root div:has(> div > [data-dock-root]), #root [data-dock-root] { background: transparent !important; }
.mantine-Paper-root, .mantine-Notifications-root, [data-portal] { display: none !important; }
</style><script>
// each station has the same page, which a browser keeps: which one stands after the #, and viser reads it from the address
if (location.hash) history.replaceState(null, "", `/scene/${location.hash.slice(1)}/`);
{ // the policy lets viser's program run, the one script element that its first script makes, and none that is made later
  const nonce = document.currentScript.nonce;
  document.createElement = (...what) => {
    const element = Document.prototype.createElement.apply(document, what);
    if (element instanceof HTMLScriptElement) {
      element.nonce = nonce;
      delete document.createElement;
    }
    return element;
  };
}
{ // the theme that was chosen on the pages (static/theme.js), or the device's, also when it changes while the scene is open
  const device = matchMedia("(prefers-color-scheme: dark)"), others = new Map();
  let dark;
  const follow = () => {
    const kept = location.protocol === "about:" ? "light" : localStorage.getItem("handscope-theme"); // a replay in a file is light
    dark = kept === "dark" || (kept !== "light" && device.matches);
    document.documentElement.classList.toggle("dark", dark);
    others.forEach(change => change());
  };
  device.addEventListener("change", follow);
  addEventListener("storage", follow);
  follow();
  window.followTheme = thing => {
    const { intensity, material } = thing;
    if (thing.isLight && !others.has(thing)) others.set(thing, () => thing.intensity = intensity * (dark ? @DIMMED@ : 1));
    if (thing.isMesh) others.set(thing, () => material.opacity = dark ? 1 : @SHADOW@);
    others.get(thing)?.();
  };
  // viser's shaders know black numbers on white alone, and one colour of the ground
  const { attachShader, shaderSource, useProgram } = WebGL2RenderingContext.prototype, themed = new WeakSet(), places = new WeakMap();
  const DARK = [
    ["vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)", "vec4(mix(vec3(1.0), vec3(@LABEL@), dark), 0.85 * vAlpha)"],
    ["vec4(0.0, 0.0, 0.0, a)", "vec4(vec3(@LABEL_INK@) * dark, a)"],
    ["vec4(gridColor, 1.0)", "vec4(mix(gridColor, vec3(@DARK_GROUND@), dark), 1.0)"],
  ];
  Object.assign(WebGL2RenderingContext.prototype, {
    shaderSource(shader, text) {
      const found = DARK.find(([light]) => text.includes(light));
      if (found) themed.add(shader);
      shaderSource.call(this, shader, found ? text.replace(...found).replace("void main()", "uniform float dark; void main()") : text);
    },
    attachShader(program, shader) {
      if (themed.has(shader)) places.set(program, null);
      attachShader.call(this, program, shader);
    },
    useProgram(program) {
      useProgram.call(this, program);
      if (!places.has(program)) return;
      if (!places.get(program)) places.set(program, this.getUniformLocation(program, "dark"));
      this.uniform1f(places.get(program), Number(dark));
    },
  });
}
{ // viser 1.1.1 leaves null for a node that is gone, looks for undefined, and falls over with every skinned mesh when it connects again
  let mutable;
  // and its unused splat sorter asks for eval, which the policy refuses
  addEventListener("unhandledrejection", event => { if (event.reason instanceof EvalError) event.preventDefault(); });
  // and it connects again in a window alone that has the focus, which a frame beside the wizard has not
  document.hasFocus = () => true;
  Object.defineProperty(window, "__viserMutable", { configurable: true, get: () => mutable, set(value) {
    mutable = value;
    mutable.nodeRefFromName = new Proxy(mutable.nodeRefFromName, {
      get: (nodes, name) => nodes[name] ?? undefined,
      set(nodes, name, node) {
        nodes[name] = node;
        if (node && !Object.hasOwn(node, "add")) setBonesApart(node);
        if (name.startsWith("/light/") || name === "@CONTACT_SHADOW@") node?.traverse(followTheme);
        if (name === "@KEY_LIGHT@") node?.children.filter(child => child.isDirectionalLight).forEach(castShadow);
        return true;
      },
    });
  } });
  // three.js looks at every bone for the picture and again for the shadow, and places those of hidden meshes: here they have a parent that is
  // never drawn itself, and is placed while the mesh is shown
  const setBonesApart = node => {
    const { add, remove, updateMatrixWorld } = node;
    const bones = new node.constructor();
    const [moveNode, moveBones] = [mover([node]), mover(bones.children)];
    node.updateMatrixWorld = force => (moveNode(true), updateMatrixWorld.call(node, force));
    bones.visible = false;
    bones.updateMatrixWorld = force => (moveBones(node.visible), node.visible && updateMatrixWorld.call(bones, force));
    node.add = (...objects) => {
      if (!objects[0]?.isBone) return add.apply(node, objects);
      if (!bones.parent) add.call(node, bones);
      bones.add(...objects);
      return node;
    };
    node.remove = (...objects) => (objects[0]?.isBone ? (bones.remove(...objects), node) : remove.apply(node, objects));
  };
  // poses come unevenly and less often than pictures, those of the ghost ten times a second: what is drawn moves towards the newest in every picture,
  // and is there after the time that lies between two of them on average; where each picture has its pose, that is at once
  const mover = objects => {
    let tracks = [], drawnAt = 0, cameAt = 0, since = 0, interval = 0, arrived = true;
    return shown => {
      if (!shown) tracks = [];
      else if (tracks.length !== 2 * objects.length)
        tracks = objects.flatMap(one => [one.quaternion, one.position]).map(now => ({ now, drawn: now.clone(), from: now.clone(), to: now.clone() }));
      const time = performance.now();
      if (tracks.some(({ now, drawn }) => !now.equals(drawn))) {
        for (const { now, drawn, from, to } of tracks) (from.copy(drawn), now.equals(drawn) || to.copy(now));
        interval += @SHARE_OF_NEWEST@ * (Math.min(time - cameAt, @LONGEST_INTERVAL@) - interval);
        [cameAt, since, arrived] = [time, drawnAt, false];
      }
      drawnAt = time;
      if (arrived) return;
      const share = Math.min(1, (time - since) / interval);
      for (const { now, drawn, from, to } of tracks) {
        now.isQuaternion ? now.slerpQuaternions(from, to, share) : now.lerpVectors(from, to, share);
        drawn.copy(now);
      }
      arrived = share === 1;
    };
  };
  // viser draws the shadow of each mesh three times, on maps of near, middle and far; one map round the hand is sharper
  const castShadow = light => {
    const { shadow } = light;
    light.castShadow = true;
    shadow.mapSize.set(1024, 1024);
    shadow.bias = -0.003;
    Object.assign(shadow.camera, { left: -@REACH@, right: @REACH@, bottom: -@REACH@, top: @REACH@, near: -@REACH@, far: @REACH@ + 2 });
    shadow.camera.updateProjectionMatrix();
  };
}
</script>"""


@dataclass(frozen=True)
class ScenePage:
    """One answer: the page, None where the browser keeps it; the Content-Security-Policy that fits it alone; the tag that it is kept under."""

    html: bytes | None
    policy: str
    tag: str


def scene_page(host: str, kept: str = "") -> ScenePage:
    """viser's page, one file without any other, for a browser that reached us as `host` (name or address with port, as the request named it).

    `kept` are the tags of pages that the browser has, as If-None-Match names them: one of today's page holds for it, with its own nonce.
    """
    digest = _client_digest()
    known = re.search(rf'"{digest}-([A-Za-z0-9_-]{{{NONCE_LENGTH}}})"', kept)
    nonce = known[1] if known else secrets.token_urlsafe(NONCE_BYTES)
    page = None if known else _TAG.sub(f'<script nonce="{nonce}"', _client_page()).encode()
    return ScenePage(page, _policy(host, nonce), f'"{digest}-{nonce}"')


def _encoded(colour: Colour) -> str:
    """As a shader writes it."""
    return ", ".join(f"{c / 255:.3f}" for c in colour)


def _linear(colour: Colour) -> str:
    """As a shader has it before light is encoded."""
    return ", ".join(f"{(c / 255) ** 2.2:.4f}" for c in colour)


NONCE_BYTES = 16
NONCE_LENGTH = 22  # characters of so many bytes in base64
_TAG = re.compile(r"<script(?=[\s>])")
_NAME = re.compile(r"@(\w+)@")
SHARE_OF_NEWEST, LONGEST_INTERVAL = 0.2, 100  # of the mean time between two poses; ms
_VALUES = {
    "SHARE_OF_NEWEST": str(SHARE_OF_NEWEST),
    "LONGEST_INTERVAL": str(LONGEST_INTERVAL),
    "KEY_LIGHT": stage.KEY_LIGHT,
    "REACH": str(stage.REACH),
    "DIMMED": str(palette.DIMMED),
    "CONTACT_SHADOW": ground.SHADOW,
    "SHADOW": str(palette.SHADOW),
    "LABEL": _encoded(palette.LABEL),
    "LABEL_INK": _encoded(palette.LABEL_INK),
    "DARK_GROUND": _linear(palette.DARK_GROUND),
}


@cache
def _client_digest() -> str:
    return hashlib.sha256(_client_page().encode()).hexdigest()[:16]


@cache
def _client_page() -> str:
    build = Path(viser.__file__).parent / "client" / "build"
    return without_controls((build / "index.html").read_text(encoding="utf-8"))


def without_controls(page: str) -> str:
    """viser's page with its own controls and messages hidden; our script comes before viser's."""
    head, title, rest = re.split(r"(<title>.*?</title>)", page, maxsplit=1)
    assert title and "<script" not in head
    return head + _NAME.sub(lambda name: _VALUES[name[1]], _HEAD) + rest


def _policy(host: str, nonce: str) -> str:
    """It lets the page connect nowhere but to us: `?websocket=` and `?playbackPath=` in a link would otherwise have it run a stranger's scripts."""
    if not re.fullmatch(r"[A-Za-z0-9.\-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?", host):
        raise ValueError(f"{host!r} is not a host name")
    rules = {
        "default-src": "'none'",
        "script-src": f"'nonce-{nonce}' 'wasm-unsafe-eval'",
        "worker-src": "blob:",
        "style-src": "'unsafe-inline'",
        "img-src": "'self' data: blob:",
        "font-src": "data:",
        "connect-src": f"'self' data: blob: ws://{host} wss://{host}",
        "frame-ancestors": "'self'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in rules.items())
