"""One scene of either hand for all tests that draw or connect."""

from collections.abc import Iterator

import pytest

from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.hand.geometry import sized
from tests.app.scene.small_site import Site, site


@pytest.fixture(scope="package")
def scene() -> Iterator[HandScene]:
    with HandScene("left", sized("left")) as one:
        yield one


@pytest.fixture(scope="package")
def right_scene() -> Iterator[HandScene]:
    with HandScene("right", sized("right")) as one:
        yield one


@pytest.fixture(scope="module")
def served(scene: HandScene) -> Iterator[Site]:
    with site(scene) as here:
        yield here
