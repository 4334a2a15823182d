"""The scene in light and in dark: as the device has it or as the pages' menu says, changed while the scene is open."""

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from handscope.app.scene import postures, view
from handscope.app.scene.angle_arc import Measured
from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.numerics.typing import Array
from tests.app.scene.small_site import Site
from tests.app.scene.test_scene_in_browser import Picture, opened, seen, settled
from tests.schedule import swept

pytestmark = pytest.mark.browser
TEXT, DRAWN = 4.5, 3.0  # WCAG 2.2 AA: of text, and of what else has to be seen


@pytest.fixture(scope="module")
def page(browser: Browser, served: Site, scene: HandScene) -> Iterator[Page]:
    """One page for all tests, the index bent by 60 deg and measured."""
    scene.show(bent(), view.palm_down("left"))
    scene.look("thumb", [bent()])
    one = opened(browser, served)
    settled(one, lambda picture: picture.share(picture.skin) > 0.02)
    yield one
    scene.measure(None)
    scene.look("back")
    one.context.close()


def bent() -> Array:
    angles = postures.relaxed()
    angles[JOINT["index_pip"], 0] = np.radians(60.0)
    return angles


def luminance(rgb: Array) -> Array:
    """Relative luminance (...,) of colours (..., 3) of 0 to 255 (WCAG 2.2)."""
    c = rgb / 255
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ np.array([0.2126, 0.7152, 0.0722]))


def contrast(one: float, other: float) -> float:
    dark, light = sorted((one, other))
    return (light + 0.05) / (dark + 0.05)


def edge(picture: Picture) -> float:
    """How bright the picture is where nothing is drawn."""
    return float(np.median(luminance(picture.rgb[:, :30].astype(float))))


def is_dark(picture: Picture) -> bool:
    return edge(picture) < 0.06


def is_light(picture: Picture) -> bool:
    return edge(picture) > 0.6


@pytest.mark.parametrize("scheme", swept(["light", "dark"], kept=["dark"]))
def test_the_scene_is_as_the_device_has_it_and_its_number_and_arc_are_seen(
    page: Page, scene: HandScene, scheme: str
) -> None:
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    scene.measure(None)
    without = settled(page, is_dark if scheme == "dark" else is_light)
    scene.measure(Measured("index_pip_flexion"))
    scene.show(bent(), view.palm_down("left"))
    with_number = settled(page, lambda p: changed(p, without).mean() > 0.001)
    drawn = changed(with_number, without)
    label = luminance(with_number.rgb[drawn].astype(float))
    assert contrast(*np.percentile(label, [3, 97])) > TEXT
    blue = drawn & is_blue(with_number)
    assert blue.sum() > 30
    assert (
        contrast(float(np.median(luminance(with_number.rgb[blue].astype(float)))), edge(without))
        > DRAWN
    )
    ground = without.rgb[:80].astype(float)
    assert contrast(*np.percentile(luminance(ground), [1, 99])) < 2.0  # its lines stay faint


def changed(one: Picture, other: Picture) -> np.ndarray:
    return np.abs(one.rgb - other.rgb).max(axis=-1) > 40


def is_blue(picture: Picture) -> np.ndarray:
    r, _, b = np.moveaxis(picture.rgb, -1, 0)
    return b > r + 60


def test_the_pages_menu_changes_an_open_scene_and_the_device_no_longer_does(
    page: Page, served: Site
) -> None:
    page.emulate_media(color_scheme="light")
    seen(page, is_light)
    beside = page.context.new_page()
    beside.goto(f"http://{served.host}/nowhere")
    beside.evaluate("localStorage.setItem('handscope-theme', 'dark')")
    dark = seen(page, is_dark)
    assert dark.share(dark.skin) > 0.02
    page.emulate_media(color_scheme="dark")
    beside.evaluate("localStorage.setItem('handscope-theme', 'light')")
    seen(page, is_light)
    beside.evaluate("localStorage.removeItem('handscope-theme')")
    seen(page, is_dark)
    beside.close()


def test_in_the_dark_the_hand_is_lit_less(page: Page, scene: HandScene) -> None:
    scene.measure(None)
    pictures = []
    for scheme, shown in (("light", is_light), ("dark", is_dark)):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        pictures.append(settled(page, shown))
    light, dark = (
        np.median(luminance(picture.rgb[pictures[0].skin].astype(float))) for picture in pictures
    )
    assert 0.4 < dark / light < 0.99
