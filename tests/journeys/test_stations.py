"""Two sessions at once on one server: two gloves, two scenes, each viewer sees the right one."""

from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Frame, Page, expect

from tests.journeys.house import act, begin_session, end_session, new_patient, scene_drawn, shown
from tests.schedule import swept

pytestmark = pytest.mark.browser
SMALL = {"width": 960, "height": 600}  # two scenes are drawn at once
PALM = "() => [...window.__viserSceneTree.getState()['/hand/palm'].message.props.vertices]"
GHOST = "(seen) => window.__viserSceneTree.getState()['/ghost'].children.length > 0 === seen"  # its parts come when they are first shown


@pytest.mark.parametrize("drawn", swept([False, True], kept=[False]))
def test_two_stations_lead_two_hands(another_page: Callable[..., Page], drawn: bool) -> None:
    left, right = (another_page(scene=drawn, at=None, viewport=SMALL) for _ in range(2))
    for page, hand in ((left, "left"), (right, "right")):
        page.goto(f"/patients/{new_patient(page)}")
        begin_session(page, hand)
    scenes = [scene_drawn(page) for page in (left, right)] if drawn else []
    if drawn:
        _show_two_hands(scenes)
    shown(act(left, "continue")).click()
    shown(left.get_by_role("heading", name="Initial pose"))
    if drawn:
        scenes[0].wait_for_function(GHOST, arg=True)
        assert scenes[1].evaluate(GHOST, False), "the right hand's scene follows the left's session"
    shown(act(right, "continue"))
    expect(right.get_by_role("heading", name="Initial pose")).to_have_count(0)

    third = another_page(scene=False, at="/patients/1")
    for hand in ("left", "right"):
        expect(third.get_by_role("radio", name=f"Virtual {hand} glove")).to_be_disabled()
    end_session(left)
    shown(act(right, "continue"))
    end_session(right)


def _show_two_hands(scenes: list[Frame]) -> None:
    """Each its own, and neither a ghost yet."""
    left, right = (np.array(scene.evaluate(PALM)) for scene in scenes)
    np.testing.assert_allclose(
        left,
        -right,
        atol=1e-6,
        err_msg="frames of a left and a right hand are each other's negative",
    )
    for scene in scenes:
        scene.wait_for_function(GHOST, arg=False)


def test_a_second_viewer_sees_the_same_session_and_both_are_led_on(
    another_page: Callable[..., Page],
) -> None:
    first = another_page(scene=False, at=None)
    first.goto(f"/patients/{new_patient(first)}")
    begin_session(first, "left")
    second = another_page(scene=False, at=first.url)
    shown(act(second, "continue")).click()
    for each in (first, second):  # the button that ends a session is another one in each step
        shown(each.get_by_role("heading", name="Initial pose"))
    shown(act(first, "start")).hover()
    first.mouse.down()
    act(second, "assist").click()  # all buttons are drawn anew
    shown(second.get_by_role("button", name="The patient takes the pose"))
    first.mouse.up()  # the button that was pressed is still there
    shown(act(first, "stop"))
    end_session(second)
    first.wait_for_url("**/sessions/*")
