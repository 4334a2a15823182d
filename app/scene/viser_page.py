"""viser's page as a browser gets it: its own controls hidden, and the security policy that it is served with.

The page's first script unpacks the viewer's program and puts it into the page as a second script. The policy names scripts by a nonce, a new
one with each answer; ours, which stands before viser's, gives it to the first script element that is made. So what viser packs and how is its
own affair: nothing here reads it. Limits: docs/security.md, "The 3-D scene's page".
"""

import re
import secrets
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import viser

from handscope.app.scene import stage

_HEAD = """<title>Hand</title><style>
html, body { margin: 0; height: 100%; background: radial-gradient(ellipse at 50% 42%, #f7f8f9 0%, #e9edf0 62%, #dde2e7 100%); }
#root div:has(> div > [data-dock-root]), #root [data-dock-root] { background: transparent !important; }
.mantine-Paper-root, .mantine-Notifications-root, [data-portal] { display: none !important; }
</style><script>
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
        if (name === "@KEY_LIGHT@") node?.children.filter(child => child.isDirectionalLight).forEach(castShadow);
        return true;
      },
    });
  } });
  // three.js looks at every bone for the picture and again for the shadow, and places those of hidden meshes: here they have a parent that is
  // never drawn itself, and is placed while the mesh is shown
  const setBonesApart = node => {
    const { add, remove } = node;
    const bones = new node.constructor();
    const { updateMatrixWorld } = bones;
    bones.visible = false;
    bones.updateMatrixWorld = force => node.visible && updateMatrixWorld.call(bones, force);
    node.add = (...objects) => {
      if (!objects[0]?.isBone) return add.apply(node, objects);
      if (!bones.parent) add.call(node, bones);
      bones.add(...objects);
      return node;
    };
    node.remove = (...objects) => (objects[0]?.isBone ? (bones.remove(...objects), node) : remove.apply(node, objects));
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
</script>""".replace("@KEY_LIGHT@", stage.KEY_LIGHT).replace("@REACH@", str(stage.REACH))


@dataclass(frozen=True)
class ScenePage:
    """One answer: the page, and the Content-Security-Policy that fits it alone."""

    html: bytes
    policy: str


def scene_page(host: str) -> ScenePage:
    """viser's page, one file without any other, for a browser that reached us as `host` (name or address with port, as the request named it)."""
    nonce = secrets.token_urlsafe(16)
    page = _TAG.sub(f'<script nonce="{nonce}"', _client_page())
    return ScenePage(page.encode(), _policy(host, nonce))


_TAG = re.compile(r"<script(?=[\s>])")


@cache
def _client_page() -> str:
    build = Path(viser.__file__).parent / "client" / "build"
    return without_controls((build / "index.html").read_text(encoding="utf-8"))


def without_controls(page: str) -> str:
    """viser's page with its own controls and messages hidden; our script comes before viser's."""
    head, title, rest = re.split(r"(<title>.*?</title>)", page, maxsplit=1)
    assert title and "<script" not in head
    return head + _HEAD + rest


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
