"""A finger that cannot be straightened: the pose asks about it, the therapist enters what a goniometer shows, and takes the pose again."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from handscope.app.commands.simulate import as_recording
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import flat, make_posture
from handscope.estimators.simulation.scenario import InertialGlove, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from handscope.sessions.motion_bids import writer
from handscope.sessions.tables_io.writing import save_file
from handscope.validation.benchmarks.server_under_test import glove
from tests.journeys.house import (
    Server,
    act,
    api,
    end_session,
    keep_screen,
    name_port,
    new_patient,
    shown,
)
from tests.journeys.test_accessibility import looked_at
from tests.simulated import strips_of

pytestmark = pytest.mark.browser
LASTS = 180.0  # s that the hand lies still: longer than two poses take on a busy machine


@pytest.fixture
def contracture(tmp_path: Path) -> Iterator[Path]:
    """A virtual glove on a hand that lies with a bent ring finger."""
    bent = make_posture(flat(), ring_pip_flexion=40.0)
    lying = task_performance.initial_pose(sized("left"), LASTS, bent)
    rng = np.random.default_rng(3)
    made = simulate_performances(
        [lying], "left", sized("left"), rng, PRESETS["MPU-9250"], InertialGlove(rate=50.0)
    )
    path, port = tmp_path / "lying.zip", tmp_path / "glove"
    save_file(writer.pack(writer.tree(as_recording(strips_of(made)), "simulated", "lying")), path)
    with glove(port, "--replay", str(path)):
        yield port


def test_a_joint_that_cannot_be_straightened_is_entered_and_the_pose_taken_again(
    another_page: Callable[..., Page], server: Server, contracture: Path
) -> None:
    page = another_page(scene=False, at=None, bypass_csp=True)
    name_port(page, f"{server.base}/patients/{new_patient(page)}", contracture)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue")).click()
    shown(act(page, "start"))
    entry = page.get_by_label("Joint", exact=True)
    expect(entry).to_be_hidden()
    keep_screen(page, "stiff-before")
    act(page, "start").click()
    shown(page.get_by_text("Bent in this pose"))
    shown(entry)  # open where it is asked
    expect(page.locator(".actions .primary")).to_have_attribute("data-act", "redo")
    keep_screen(page, "stiff-asked")
    page.get_by_role("button", name="Add").click()
    shown(page.get_by_text("Choose a joint and enter its flexion"))
    expect(entry).to_have_value("ring_pip")  # chosen where it is asked about
    page.get_by_label("Flexion, °").fill("400")
    page.get_by_role("button", name="Add").click()
    shown(page.get_by_text("Ring PIP cannot be at 400 deg"))
    page.get_by_label("Flexion, °").fill("40")
    page.get_by_label("Flexion, °").press("Enter")
    shown(page.get_by_text("40° flexed"))
    shown(page.get_by_text("This counts from the next pose on"))
    expect(page.locator(".actions .primary")).to_have_attribute("data-act", "redo")
    keep_screen(page, "stiff-entered")
    looked_at(page, "a stiff joint entered")
    act(page, "redo").click()
    shown(act(page, "start"))
    page.reload()
    shown(page.get_by_role("button", name="Remove Ring PIP"))
    keep_screen(page, "stiff-again")
    act(page, "start").click()
    shown(act(page, "accept"))
    expect(page.get_by_text("Bent in this pose")).to_have_count(0)
    keep_screen(page, "stiff-counted")
    page.get_by_role("button", name="Remove Ring PIP").click()
    expect(page.get_by_text("40° flexed")).to_have_count(0)
    station = page.url.rsplit("/", 1)[1]
    assert api(page, f"/api/stations/{station}")["stiff_joints"]["angles"] == {}
    end_session(page)
