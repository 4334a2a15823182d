"""Joints that cannot be straightened: asked about once, entered as a goniometer shows them, and right in every pose from then on."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.app.live.measured_pose import GONIOMETER_SD
from handscope.app.live.station import Station
from handscope.app.live.wizard.effects import Calibrate
from handscope.app.live.wizard.machine import State
from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.estimators.finger_ekf.pose_error.bent_joints import HINGED as ASKED
from handscope.estimators.hand.anatomy import FLEXION, HINGES, JOINT, JOINTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import flat, make_posture
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from tests.app.devices.virtual import wait_for
from tests.app.live.test_live_numbers import station  # noqa: F401  a fixture
from tests.app.live.test_trial_events import kept
from tests.app.live.wizard.test_machine import READY
from tests.simulated import DEG, strips_of

STIFF = {"ring_pip": 40.0, "little_pip": 35.0}  # deg
COLUMNS = {f"{joint}_flexion_deg": angle for joint, angle in STIFF.items()}
SD_COLUMNS = {f"{joint}_flexion_sd_deg": GONIOMETER_SD for joint in STIFF}


@cache
def contracture() -> Simulated:
    """Two poses and a tapping of a hand with two fingers that cannot be straightened, a stream a strip."""
    bent = make_posture(flat(), **{f"{joint}_flexion": angle for joint, angle in STIFF.items()})
    done = [task_performance.initial_pose(sized("left"), taken=bent) for _ in range(2)]
    done.append(task_performance.TASKS["tapping"](sized("left")))
    rng = np.random.default_rng(3)
    return strips_of(simulate_performances(done, "left", sized("left"), rng, PRESETS["MPU-9250"]))


def take_pose(station: Station, stored: Sequence[Event], pose: Event) -> None:  # noqa: F811
    """As the wizard does once it was held still."""
    before = len(stored)
    station._wizard = replace(station._wizard, state=State.POSE_WORK)
    station._carry_out([Calibrate(pose.onset, pose.end)], READY)
    wait_for(lambda: len(stored) > before)
    wait_for(lambda: station._wizard.state is State.POSE_REVIEW)


def test_joints_that_were_measured_are_asked_about_no_more_and_right_in_every_pose(
    station: Station,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stored, recording = kept(station, monkeypatch), contracture()
    station.glove.assembler.mounting |= recording.mounting
    station.tracking._process(list(recording.samples.values()))
    first, second = (e for e in recording.events if e.trial_type == "initial_pose")

    def shown() -> tuple[list[str], bool]:
        entered = station.snapshot()["stiff_joints"]
        return entered["asked"], entered["pending"]

    take_pose(station, stored, first)
    assert shown() == ([*STIFF], False)
    assert (
        station._wizard.poor == 0
    )  # no movements are proposed: a bent joint is no sensor that sits turned
    assert not {*COLUMNS} & {*stored[0].details}
    station.measured_pose.use_goniometer(STIFF)
    assert shown() == ([*STIFF], True)
    for pose in (first, second):
        take_pose(station, stored, pose)
        assert shown() == ([], False)
        assert stored[-1].details.items() >= {**COLUMNS, **SD_COLUMNS}.items()
    moved = station.tracking.past(second.end + 3.0)
    rows = np.searchsorted(recording.truth.t, moved.t).clip(0, len(recording.truth.t) - 1)
    for joint in STIFF:
        off = (moved.angles - recording.truth.angles[rows])[:, JOINT[joint], FLEXION]
        assert abs(np.nanmean(off)) < 6 * DEG
    station.measured_pose.use_goniometer({})
    assert shown() == ([], True)
    take_pose(station, stored, second)
    assert not {*COLUMNS} & {*stored[-1].details}


def test_joints_are_those_that_a_pose_asks_about_and_nothing_else_is_taken(
    station: Station,  # noqa: F811
) -> None:
    assert tuple(JOINTS[j].name for j in ASKED) == HINGES
    with pytest.raises(InputError):
        station.measured_pose.use_goniometer({"ring_pip": 40.0, "little_pip": float("nan")})
    assert station.measured_pose.columns() == {}
