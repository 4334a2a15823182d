"""The scene in a real browser, at the sizes of a clinic's screens: what is drawn, in which colours, after what happened."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page

from handscope.app.scene import postures, view
from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.hand.anatomy import FINGERS, JOINT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Bools
from handscope.estimators.simulation.movements import task_performance
from tests.app.scene.drawing_calls import COUNTED
from tests.app.scene.small_site import COOKIE, PICTURE, SELDOM, WAIT, Site, eventually, site
from tests.browser import UNDRAWN

pytestmark = pytest.mark.browser
SIZES = {"wide": (1440, 900), "small": (1024, 768), "narrow": (420, 700)}
QUICK = (640, 480)  # without a graphics card a larger picture takes seconds
DROPPED = "counted.drop = true;"
Mask = Bools
DRAWN = "(pictures) => new Promise((done) => { const next = () => (pictures-- ? requestAnimationFrame(next) : done()); next(); })"


@dataclass
class Asked:
    """What the shared page asked for until the hand was there: addresses, and the origins of its web sockets."""

    addresses: list[str] = field(default_factory=list)
    sockets: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def asked() -> Asked:
    return Asked()


@pytest.fixture(scope="module")
def undrawn(browser: Browser, served: Site, asked: Asked) -> Iterator[Page]:
    """A page on the left hand's scene, where what is to be drawn is counted and dropped."""
    before = len(served.sockets)
    one = opened(browser, served, asked.addresses.append, COUNTED + DROPPED + SELDOM)
    asked.sockets += served.sockets[before:]
    yield one
    one.context.close()


@pytest.fixture(scope="module")
def drawn(browser: Browser, served: Site) -> Iterator[Page]:
    """One page for all tests that look at what is drawn and need no page of their own: each costs seconds until its light is there."""
    one = opened(browser, served)
    settled(one, hand_like)
    yield one
    one.context.close()


@pytest.fixture
def page(drawn: Page) -> Page:
    """That page, as small as at first."""
    resized(drawn, QUICK)
    return drawn


@pytest.fixture(autouse=True)
def plain(scene: HandScene, right_scene: HandScene) -> None:
    """Every test begins with a resting hand, all of it measured, nothing else shown."""
    for each in (scene, right_scene):
        each.face_ahead()
        each.measured(FINGERS)
        each.ghost(None)
        each.highlight(None)
        each.trail(np.empty((0, 3)))
        each.show(postures.relaxed(), view.palm_down(each._hand))


def resized(page: Page, size: tuple[int, int]) -> None:
    page.set_viewport_size(dict(zip(("width", "height"), size)))  # type: ignore[arg-type]


def opened(
    browser: Browser,
    served: Site,
    hear: Callable[[str], None] = lambda url: None,
    script: str = SELDOM,
) -> Page:
    """The page of a scene, logged in, when the hand has come."""
    width, height = QUICK
    context = browser.new_context(viewport={"width": width, "height": height})
    context.add_cookies([{**COOKIE, "url": f"http://{served.host}"}])  # type: ignore[list-item, typeddict-item]
    context.add_init_script(script)
    page = context.new_page()
    page.on("request", lambda request: hear(request.url))
    page.goto(served.address)
    page.wait_for_function(
        "() => window.__viserSceneTree?.getState()['/hand/palm'] !== undefined", timeout=1e3 * WAIT
    )
    return page


class Picture:
    """A screenshot, and where in it what is seen."""

    def __init__(self, png: bytes) -> None:
        self.png = png
        self.rgb = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
        r, g, b = np.moveaxis(self.rgb, -1, 0)
        self.skin: Mask = (r > g + 12) & (g > b + 8) & (r > 110)
        self.warm: Mask = r > b + 8  # skin and nails, which are paler where the light falls on them
        self.ghost: Mask = (b > r + 35) & (b > 205) & (g > r + 20)
        self.lit: Mask = (b > r + 90) & (r < 90) & (b > 110)
        self.cuff: Mask = (b > r + 12) & (b < 175) & (r > 40) & ~self.lit

    def share(self, mask: Mask) -> float:
        return float(mask.mean())


def seen(page: Page, condition: Callable[[Picture], object], keep: Path | None = None) -> Picture:
    """Look until what is drawn is as wanted."""
    picture = [Picture(page.screenshot(timeout=1e3 * WAIT))]

    def looked() -> bool:
        picture.append(Picture(page.screenshot(timeout=1e3 * WAIT)))
        return bool(condition(picture[-1]))

    try:
        eventually(looked, every=PICTURE / 2)
    finally:
        if keep is not None:
            keep.write_bytes(picture[-1].png)
    return picture[-1]


def settled(
    page: Page, condition: Callable[[Picture], object], keep: Path | None = None
) -> Picture:
    """The same some pictures later: on a page that draws seldom the first may still be of what was shown before."""
    seen(page, condition)
    page.evaluate(DRAWN, 3)
    return seen(page, condition, keep)


def hand_like(picture: Picture) -> bool:
    """Enough skin, most of it in the middle, the cuff below it, nothing of it at the border."""
    height, width = picture.skin.shape
    rows, columns = np.nonzero(picture.skin)
    if not 0.015 < picture.share(picture.skin) < 0.35 or picture.share(picture.cuff) < 0.002:
        return False
    central = (abs(columns - width / 2) < 0.42 * min(width, height)).mean()
    border = picture.skin[[0, -1]].any() or picture.skin[:, [0, -1]].any()
    return bool(
        central > 0.97 and not border and np.median(np.nonzero(picture.cuff)[0]) > np.median(rows)
    )


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [("wide", "small"), ("narrow",)], ids="-".join)
def test_a_hand_is_drawn_in_the_middle_at_every_size(
    page: Page, scene: HandScene, sizes: tuple[str, ...], tmp_path: Path
) -> None:
    for size in sizes:
        resized(page, SIZES[size])
        scene.show(postures.relaxed(), None)
        resting = settled(
            page, hand_like, tmp_path / f"resting-{size}.png"
        )  # the first pictures are darker: its light is still to come
        scene.show(postures.angles_of(task_performance.spread()), None)
        more = 1.1 * resting.share(resting.skin)
        wider = 1.2 * np.ptp(
            np.nonzero(resting.skin)[1]
        )  # light alone makes more skin, not a wider hand
        spread = lambda p: (  # noqa: E731
            hand_like(p) and p.share(p.skin) > more and np.ptp(np.nonzero(p.skin)[1]) > wider  # noqa: B023
        )
        seen(page, spread, tmp_path / f"spread-{size}.png")


def test_a_picture_of_the_hand_takes_few_calls_and_triangles(
    undrawn: Page, scene: HandScene
) -> None:
    """Of a whole hand with its shadow; a tablet's graphics processor has 16 ms for it."""
    page = undrawn
    for measured, calls in ((FINGERS, 13), (("thumb", "index"), 14)):
        scene.measured(measured)
        page.evaluate(DRAWN, 3)
        page.evaluate("Object.assign(counted, { rendered: 0, calls: 0, triangles: 0 })")
        page.wait_for_function("() => counted.rendered", timeout=1e3 * WAIT)
        drawn = page.evaluate("counted")
        assert drawn["calls"] <= calls * drawn["rendered"]
        assert 30_000 < drawn["triangles"] / drawn["rendered"] < 50_000


def test_one_light_casts_one_shadow(undrawn: Page) -> None:
    """Each light that does draws the hand again; none would leave the hand flat."""
    casting = """() => {
      const found = [];
      __viserMutable.scene.traverse(one => one.isLight && one.castShadow && found.push(one.shadow.mapSize.width));
      return found;
    }"""
    assert undrawn.evaluate(casting) == [1024]


def test_bones_move_the_skin_and_are_not_looked_at_for_the_picture(undrawn: Page) -> None:
    """three.js goes through everything visible twice for a picture: once for its shadow."""
    looked_at = """() => {
      const [all, seen] = [[], []];
      __viserMutable.scene.traverse(one => one.isBone && all.push(one));
      __viserMutable.scene.traverseVisible(one => one.isBone && seen.push(one));
      return [all.length, seen.length];
    }"""
    placed, looked = undrawn.evaluate(looked_at)
    assert placed > 40 and looked == 0


def test_bones_move_evenly_in_every_picture_between_poses_that_come_less_often(
    undrawn: Page,
) -> None:
    """Sixty pictures a second, and a pose for every third: by a clock of the test's own."""
    walk = """() => {
      const bone = __viserMutable.nodeRefFromName["/hand/fingers"].getObjectByProperty("isBone", true);
      const before = bone.position.x, places = [];
      let time = performance.now() + 1e3;
      performance.now = () => time;
      for (let picture = 0; picture < 120; picture++, time += 1e3 / 60) {
        if (picture % 3 === 0 && picture < 90) bone.position.x = before + picture;
        bone.parent.updateMatrixWorld(true);
        places.push(bone.position.x - before);
      }
      bone.position.x = before;
      bone.parent.updateMatrixWorld(true);
      delete performance.now;
      return places;
    }"""
    shown = '() => __viserMutable.nodeRefFromName["/hand/fingers"].visible'
    undrawn.wait_for_function(shown, timeout=1e3 * WAIT)
    places = np.array(undrawn.evaluate(walk))
    np.testing.assert_allclose(np.diff(places)[60:89], 1.0, atol=0.02)
    assert places[-1] == 87.0  # where the last pose is


def test_one_page_opens_one_socket_to_us_and_nothing_else(
    undrawn: Page, asked: Asked, served: Site
) -> None:
    assert asked.sockets == [f"http://{served.host}"]
    elsewhere = [
        url
        for url in asked.addresses
        if not url.startswith((f"http://{served.host}/", "data:", "blob:"))
    ]
    assert served.address in asked.addresses and elsewhere == []


@pytest.mark.slow
def test_the_thumb_of_a_left_hand_reaches_out_to_the_right(
    page: Page, scene: HandScene, tmp_path: Path
) -> None:
    assert thumb_side(page, scene, tmp_path / "left.png") > 25  # palm down


@pytest.mark.slow
def test_left_and_right_are_told_apart(
    page: Page, browser: Browser, scene: HandScene, right_scene: HandScene, tmp_path: Path
) -> None:
    left = thumb_side(page, scene, tmp_path / "left.png")
    with site(right_scene) as other:
        right_page = opened(browser, other)
        right = thumb_side(right_page, right_scene, tmp_path / "right.png")
        right_page.context.close()
    assert left > 25 and right < -25
    assert left == pytest.approx(-right, abs=5)


def thumb_side(page: Page, scene: HandScene, keep: Path) -> float:
    """How much further a flat hand reaches to the right of the middle than to the left, pixels: the thumb does."""
    scene.show(postures.angles_of(task_performance.flat()), None)
    flat = settled(page, lambda p: hand_like(p) and np.ptp(np.nonzero(p.skin)[1]) > 105, keep)
    columns = np.nonzero(flat.warm)[1] - QUICK[0] / 2
    return float(columns.max() + columns.min())


@pytest.mark.slow
def test_a_page_that_lost_its_connection_comes_back_with_the_newest_hand(
    page: Page, scene: HandScene, served: Site, tmp_path: Path
) -> None:
    """viser's own page goes blank: it falls over when it clears skinned meshes away."""
    failures: list[str] = []
    page.on("pageerror", lambda error: failures.append(str(error)))
    resting = settled(page, hand_like)
    before = len(served.sockets)
    scene._server._websock_server.disconnect_all_clients()
    eventually(lambda: len(served.sockets) > before)
    scene.show(postures.angles_of(task_performance.spread()), None)
    seen(
        page,
        lambda p: hand_like(p) and p.share(p.skin) > 1.1 * resting.share(resting.skin),
        tmp_path / "again.png",
    )
    assert failures == []


def test_a_scene_in_a_frame_connects_again_although_somebody_works_beside_it(
    browser: Browser, scene: HandScene, served: Site
) -> None:
    """viser's own page waits until it has the focus."""
    context = browser.new_context(viewport={"width": 320, "height": 240})
    context.add_cookies([{**COOKIE, "url": f"http://{served.host}"}])  # type: ignore[list-item, typeddict-item]
    context.add_init_script(SELDOM + UNDRAWN)
    page = context.new_page()
    around = f'<button>Continue</button><iframe src="{served.path}"></iframe>'
    page.route("**/around", lambda route: route.fulfill(body=around, content_type="text/html"))
    viewers, before = scene._server._websock_server._client_state_from_id, len(served.sockets)
    others = len(viewers)
    page.goto(f"http://{served.host}/around")
    page.get_by_role("button", name="Continue").click()
    eventually(lambda: page.title() == "" and len(viewers) > others)
    scene._server._websock_server.disconnect_all_clients()
    eventually(
        lambda: (
            page.title() == ""
            and len(served.sockets) >= before + 2 + others
            and len(viewers) > others
        )
    )
    context.close()


@pytest.mark.slow
def test_the_ghost_comes_in_another_hue_and_goes(
    page: Page, scene: HandScene, tmp_path: Path
) -> None:
    seen(page, lambda p: hand_like(p) and p.share(p.ghost) < 1e-4)
    scene.ghost(postures.angles_of(task_performance.flat()))
    seen(page, lambda p: hand_like(p) and p.share(p.ghost) > 0.004, tmp_path / "ghost.png")
    bent = postures.relaxed()
    bent[JOINT["wrist"]] = [-0.7, 0, 0]
    scene.ghost(bent)
    seen(page, lambda p: p.share(p.ghost) > 0.004, tmp_path / "wrist.png")
    scene.ghost(None)
    seen(page, lambda p: hand_like(p) and p.share(p.ghost) < 1e-4)


@pytest.mark.slow
def test_one_segment_is_lit_and_no_other(page: Page, scene: HandScene, tmp_path: Path) -> None:
    scene.show(postures.angles_of(task_performance.flat()), None)
    where = {}
    for segment in ("index_middle", "little_middle", "thumb_distal"):
        scene.highlight(segment)
        lit = seen(
            page,
            lambda p: hand_like(p) and 3e-4 < p.share(p.lit) < 0.01,
            tmp_path / f"{segment}.png",
        )
        where[segment] = np.median(np.nonzero(lit.lit)[1])
        scene.highlight(None)
        seen(page, lambda p: p.share(p.lit) < 2e-5)
    assert where["little_middle"] < where["index_middle"] < where["thumb_distal"]


@pytest.mark.slow
def test_fingers_that_are_not_measured_are_pale(
    page: Page, scene: HandScene, tmp_path: Path
) -> None:
    scene.show(postures.angles_of(task_performance.flat()), None)
    whole = settled(
        page, lambda p: hand_like(p) and np.ptp(np.nonzero(p.skin)[0]) > 155, tmp_path / "whole.png"
    )
    scene.measured(["thumb"])
    seen(
        page,
        lambda p: np.ptp(np.nonzero(p.skin)[0]) < 0.8 * np.ptp(np.nonzero(whole.skin)[0]),
        tmp_path / "pale.png",
    )


@pytest.mark.slow
def test_the_hand_turns_as_it_is_turned(page: Page, scene: HandScene, tmp_path: Path) -> None:
    level = view.palm_down("left")
    scene.show(postures.angles_of(task_performance.flat()), level)
    flat = settled(page, lambda p: hand_like(p) and np.ptp(np.nonzero(p.skin)[1]) > 105)
    scene.show(
        postures.angles_of(task_performance.flat()), quat.multiply(quat.about(1, np.pi), level)
    )
    thumb = np.nonzero(flat.skin)[1].max() - QUICK[0] / 2
    seen(
        page,
        lambda p: QUICK[0] / 2 - np.nonzero(p.skin)[1].min() > 0.8 * thumb,
        tmp_path / "palm-up.png",
    )


@pytest.mark.slow
def test_where_the_hand_has_been_is_a_line_that_comes_and_goes(
    page: Page, scene: HandScene, tmp_path: Path
) -> None:
    line = lambda p: (p.rgb[..., 2] > p.rgb[..., 0] + 60) & (p.rgb[..., 2] > 120)  # noqa: E731
    seen(page, lambda p: hand_like(p) and line(p).sum() == 0)
    angle = np.linspace(0.0, 1.5 * np.pi, 200)
    circle = 0.05 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    scene.trail(circle - circle[-1])
    drawn = seen(page, lambda p: line(p).sum() > 200, tmp_path / "trail.png")
    rows, columns = np.nonzero(line(drawn))
    assert np.ptp(columns) > 60 and np.ptp(rows) > 25  # three quarters of a circle, seen from above
    scene.trail(circle[:0])
    seen(page, lambda p: hand_like(p) and line(p).sum() == 0)


@pytest.mark.slow
def test_what_fingertips_push_with_is_an_arrow_and_a_number_each(
    page: Page, scene: HandScene, tmp_path: Path
) -> None:
    ink = lambda p: (p.rgb.max(axis=-1) < 50).sum()  # noqa: E731
    arrow = lambda p: (  # noqa: E731
        (p.rgb[..., 0] > 150) & (p.rgb[..., 1] < 0.62 * p.rgb[..., 0]) & (p.rgb[..., 2] < 70)
    )
    bare = seen(page, lambda p: hand_like(p) and arrow(p).sum() == 0)
    forces, level = np.full((5, 3), np.nan), view.palm_down("left")
    scene.show(postures.relaxed(), level)
    forces[FINGERS.index("index")] = quat.rotate(
        level, np.array([0.0, 8.0, 0.0])
    )  # along the fingers, away from the viewer
    forces[FINGERS.index("thumb")] = 0.1  # N: what is left of a zero
    scene.forces(forces)
    one = settled(page, lambda p: arrow(p).sum() > 40 and ink(p) > ink(bare) + 20)
    forces[FINGERS.index("thumb")] = quat.rotate(
        level, np.array([0.0, 0.0, -8.0])
    )  # away from the hand, where nothing hides it
    scene.forces(forces)
    seen(
        page,
        lambda p: arrow(p).sum() > 1.4 * arrow(one).sum() and ink(p) > ink(one) + 20,
        tmp_path / "forces.png",
    )
    scene.forces(None)
    seen(page, lambda p: hand_like(p) and arrow(p).sum() == 0)


@pytest.mark.parametrize("size", SIZES)
def test_viser_shows_nothing_of_its_own(undrawn: Page, size: str) -> None:
    resized(undrawn, SIZES[size])
    assert undrawn.title() == "Hand"
    undrawn.wait_for_function(
        "() => document.querySelector('.mantine-Paper-root, [data-floating-window]') !== null"
    )  # it is there, but hidden
    assert undrawn.locator("button:visible, input:visible, a:visible").count() == 0
    assert undrawn.locator("body").inner_text().strip() == ""


def test_who_is_not_logged_in_gets_no_page(browser: Browser, served: Site) -> None:
    context = browser.new_context()
    assert context.request.get(served.address).status == 401
    context.close()
