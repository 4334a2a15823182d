"""A replay in one file: the movement in it is what was measured, nothing tells who moved, and a browser without a network plays it."""

import base64
import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from handscope.app.language import ENGLISH, languages
from handscope.app.protocols import load_all
from handscope.app.replay_file import FULL, RATE, Chapter, chapters, replay_file, thinned
from handscope.app.scene import postures, view
from handscope.app.scene.mesh import bones
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import JOINT, JOINTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from tests.browser import UNDRAWN

GEOMETRY = sized("left")
T = np.arange(600) / 60.0


def movement() -> dict[str, np.ndarray]:
    """Ten seconds in which all fingers bend and the hand turns; the little finger is not measured."""
    angles = np.zeros((len(T), len(JOINTS), 3))
    angles[:, :, 0] = 0.6 - 0.6 * np.cos(T)[:, None]
    angles[:, [JOINT[f"little_{j}"] for j in ("mcp", "pip", "dip")]] = np.nan
    q_GH = quat.multiply(view.palm_down("left"), quat.about(2, 0.3 * np.sin(T)))
    return {"t": 5.0 + T, "angles": angles, "q_GH": q_GH}


@pytest.fixture(scope="module")
def page() -> str:
    return replay_file(
        "left", GEOMETRY, movement(), [Chapter("Fist <1>", 6.0, 9.0)], "Hand & movement", ENGLISH
    ).decode()


def held(page: str, name: str) -> str:
    found = re.search(rf'id="{name}">([^<]*)</script>', page)
    assert found
    return found[1]


def test_the_movement_in_the_file_is_the_one_that_was_measured(page: str) -> None:
    told = json.loads(held(page, "payload"))
    steps = np.frombuffer(gzip.decompress(base64.b64decode(held(page, "movement"))), "<i2").reshape(
        -1, len(told["t"])
    )
    numbers = np.cumsum(steps, axis=1, dtype="<i2").T.astype(float)
    n = told["bones"]
    turns, places = (
        numbers[:, 4 : 4 + 4 * n].reshape(-1, n, 4) / FULL,
        numbers[:, 4 + 4 * n :].reshape(-1, n, 3) * told["reach"],
    )
    assert len(told["t"]) == pytest.approx(10 * RATE, abs=1)
    k = len(told["t"]) // 2
    row = int(np.argmin(np.abs(T - told["t"][k])))
    wanted = bones.pose(postures.filled(movement()["angles"][row]), GEOMETRY)
    np.testing.assert_allclose(turns[k], wanted[0], atol=1 / FULL)
    np.testing.assert_allclose(
        places[k], wanted[1] * view.units_per_metre(GEOMETRY), atol=told["reach"]
    )
    assert np.abs(np.linalg.norm(numbers[:, :4] / FULL, axis=1) - 1).max() < 1e-3
    assert told["chapters"] == [{"title": "Fist <1>", "start": 1.0, "stop": 4.0}]
    assert {bone for mesh in told["parts"].values() for bone in mesh} <= set(range(n))


def test_nothing_in_it_needs_a_network_or_leaves_its_place(page: str) -> None:
    ours = page[: page.index('id="packed-scene"')]
    assert "<title>Hand &amp; movement</title>" in page
    assert not re.search(r"@(title|payload|movement|scene|player|notice|language)@", page)
    assert "http://" not in ours and "https://" not in ours
    assert "default-src 'none'" in ours
    assert "\\u003c1>" in held(page, "payload")
    assert len(page) < 2.5e6


def test_an_orientation_that_is_not_known_is_the_one_before() -> None:
    told = movement()
    told["q_GH"][:100] = told["q_GH"][300:400] = np.nan
    _, _, q = thinned(told["t"], told["angles"], told["q_GH"])
    np.testing.assert_array_equal(q[0], told["q_GH"][100])
    np.testing.assert_array_equal(q[160], told["q_GH"][299])
    _, _, q = thinned(told["t"], told["angles"], np.full_like(told["q_GH"], np.nan))
    np.testing.assert_array_equal(q[5], quat.IDENTITY)


def test_chapters_are_named_in_the_language_asked_for() -> None:
    told = [
        Event(0, 3, "initial_pose"),
        Event(4, 9, "task", {"task_name": "tapping"}),
        Event(14, 9, "task", {"task_name": "tapping"}),
    ]
    found = chapters([*told, Event(20, 1, "annotation")], load_all(), languages()["de"])
    assert [c.title for c in found] == ["Ausgangsstellung", "Fingertippen 1", "Fingertippen 2"]


@pytest.mark.browser
def test_a_browser_without_a_network_plays_it(page: str, tmp_path: Path, browser: Browser) -> None:
    (tmp_path / "replay.html").write_text(page, "utf-8")
    with browser.new_context(viewport={"width": 500, "height": 400}) as context:
        context.add_init_script(UNDRAWN)
        shown = context.new_page()
        asked: list[str] = []
        shown.on(
            "request",
            lambda request: (
                asked.append(request.url) if request.url.startswith(("http", "ws")) else None
            ),
        )
        context.set_offline(True)
        shown.goto((tmp_path / "replay.html").as_uri())
        shown.wait_for_selector("html[data-ready]", timeout=60_000)
        shown.locator("#where").fill("3.14")
        assert shown.locator("#clock").inner_text() == "3.1 of 10.0 s"
        shown.get_by_role("button", name="Fist").click()
        assert shown.locator("#where").input_value() == "1"
        shown.keyboard.press("ArrowRight")
        assert shown.locator("#where").input_value() == "2"
        frame = shown.frames[1]
        assert frame.evaluate(
            "window.__viserMutable.skinnedMeshState['\\u0000/hand/palm'] !== undefined"
        )
        assert asked == []
