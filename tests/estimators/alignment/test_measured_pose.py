"""A pose whose angles were measured: they take the place of the straight hand, and of what a person misses it by."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import DEVIATION, FINGERS, JOINT
from handscope.estimators.methods import METHODS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.experiments import EXPERIMENTS, PersonErrors, record_experiment
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import DEG

MEASURED = [JOINT[f"{finger}_mcp"] for finger in FINGERS[1:]]


@pytest.fixture(scope="module")
def missed() -> Simulated:
    """Somebody who spreads the fingers by up to 8 deg in the pose, with sensors that do not err."""
    return record_experiment(
        EXPERIMENTS["A-F2"],
        np.random.default_rng(5),
        IDEAL,
        None,
        person=PersonErrors(pose_deg=8.0, lengths=False, wrist_deg=0.0),
    )


def with_measured_pose(recording: Simulated, sd: float = 0.5) -> Simulated:
    """The same recording, its pose with the spread of the fingers as a sheet would show it."""
    pose = next(e for e in recording.events if e.trial_type == "initial_pose")
    angles = recording.truth.angles[recording.truth.t <= pose.end][-1]
    details = {}
    for finger in FINGERS[1:]:
        column = f"{finger}_mcp_deviation"
        details[f"{column}_deg"] = str(angles[JOINT[f"{finger}_mcp"], DEVIATION] / DEG)
        details[f"{column}_sd_deg"] = sd
    events = [
        replace(e, details={**e.details, **details}) if e is pose else e for e in recording.events
    ]
    return replace(recording, events=tuple(events))


@pytest.mark.parametrize("name", ["m2", "ekf"])
def test_what_a_pose_was_missed_by_is_no_offset_where_it_was_measured(
    missed: Simulated, name: str
) -> None:
    method = METHODS[name]
    errors = []
    for recording in (missed, with_measured_pose(missed)):
        moved = process(method, method.Params(), recording).trajectory
        rows = np.searchsorted(recording.truth.t, moved.t)
        off = (
            moved.angles[:, MEASURED, DEVIATION]
            - recording.truth.angles[rows][:, MEASURED, DEVIATION]
        )
        errors.append(np.sqrt(np.nanmean(off[moved.t > 5] ** 2)) / DEG)
    assert errors[0] > 3 and errors[1] < 1


def test_a_measured_angle_is_as_sure_as_it_was_measured(missed: Simulated) -> None:
    method, sd = METHODS["ekf"], []
    for recording in (missed, with_measured_pose(missed, 0.2)):
        moved = process(method, method.Params(), recording).trajectory
        assert moved.angles_sd is not None
        sd.append(np.nanmean(moved.angles_sd[:, MEASURED, DEVIATION]) / DEG)
    assert sd[1] < sd[0] - 0.3


def test_segments_follow_each_other_outwards_from_the_hand() -> None:
    details = {
        "index_mcp_deviation_deg": 10,
        "index_pip_flexion_deg": "20",
        "wrist_deviation_deg": -5,
    }
    q = initial_pose.segments_in_pose(
        initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", details))
    )
    mcp = joint_angles.compose(np.array([0.0, 10 * DEG, 0.0]))
    pip = joint_angles.compose(np.array([20 * DEG, 0.0, 0.0]))
    np.testing.assert_allclose(q["index_proximal"], mcp, atol=1e-12)
    np.testing.assert_allclose(q["index_distal"], quat.multiply(mcp, pip), atol=1e-12)
    np.testing.assert_allclose(q["middle_distal"], quat.IDENTITY, atol=1e-12)
    wrist = joint_angles.decompose(quat.relative(q["forearm"], q["hand"]))
    np.testing.assert_allclose(wrist / DEG, [0, -5, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("index_mcp_deviation_deg", "much"),
        ("wrist_deviation_deg", float("inf")),
        ("index_mcp_deviation_sd_deg", 0),
        ("index_mcp_deviation_sd_deg", "-1"),
    ],
)
def test_what_is_no_angle_is_refused_with_its_column(column: str, value: object) -> None:
    with pytest.raises(InputError, match=column):
        initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", {column: value}))


def test_not_available_is_not_measured() -> None:
    details = {"index_mcp_deviation_deg": None, "index_mcp_deviation_sd_deg": None}
    pose = initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", details))
    assert pose.measured == {} and pose.sd == {}
