"""A sensor at fault, where the filter estimates a finger's sensors together: nothing of that finger is good."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.hand.anatomy import CHAINS, CHILDREN, IS_DOF, JOINT, JOINTS, SEGMENT
from handscope.estimators.hand.anatomy import SEGMENTS as ALL
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import ALL_METHODS, ekf, m2
from handscope.estimators.pipeline.coupled_segments import coupled_segments, remembered, restarts_of
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.recording_checks import check
from handscope.estimators.recording_checks.check import check_processed
from handscope.estimators.simulation.experiments import EXPERIMENTS, PersonErrors, record_experiment
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors

FAULTY = "index_distal"
WRONG = np.uint8(Flag.FAULTY | Flag.DOUBTFUL)
INDEX = [k for k, joint in enumerate(JOINTS) if joint.child in CHAINS["index"]]
OTHERS = [k for k, joint in enumerate(JOINTS) if joint.child not in CHAINS["index"]]


@cache
def intact() -> Simulated:
    """A hand that moves freely for half a minute."""
    return record_experiment(
        EXPERIMENTS["free"],
        np.random.default_rng(3),
        SensorErrors(),
        None,
        "left",
        person=PersonErrors(pose_deg=2.0),
    )


@cache
def negated(sensor: str = FAULTY) -> Simulated:
    """The same, one gyroscope's z axis read with the wrong sign."""
    (block,) = intact().samples.values()
    values, k = block.values.copy(), block.stream.sensors.index(sensor)
    rates = values[:, k, block.stream.axes(GYR)]
    rates[:, 2] *= -1.0
    return replace(intact(), samples={block.stream.name: Block(block.stream, block.t, values)})


@cache
def by_ekf(sensor: str = FAULTY) -> tuple[Processed, Processed]:
    """As the filter gives it, and checked."""
    made = process(ekf, ekf.Params(), negated(sensor))
    flags = made.trajectory.flags.copy()
    checked = check_processed(made, negated(sensor))
    return replace(made, trajectory=replace(made.trajectory, flags=flags)), checked


@cache
def _of_intact() -> Processed:
    return process(ekf, ekf.Params(), intact())


def of_intact() -> Processed:
    """As the filter gives the intact recording, with flags of its own: checks set them."""
    made = _of_intact()
    return replace(made, trajectory=replace(made.trajectory, flags=made.trajectory.flags.copy()))


def grades(made: Processed) -> dict[str, str]:
    """Of all figures of the free movement, by name."""
    results = assess(made.trajectory, negated().events)
    return {figure.name: figure.grade for result in results for figure in result.figures}


def wrong_segments(made: Processed) -> set[str]:
    """Segments that are at fault or doubtful throughout."""
    return {s for s in ALL if ((made.trajectory.flags[:, SEGMENT[s]] & WRONG) != 0).all()}


def test_no_figure_of_the_finger_is_good_and_those_of_the_others_are_as_before() -> None:
    made, checked = by_ekf()
    assert [s.sensors for s in checked.suspicions if s.message.severity == "fault"] == [(FAULTY,)]
    before, after = grades(made), grades(checked)
    ours = {name for name in before if name.startswith("index_")}
    assert {"index_mcp_flexion_max", "index_pip_flexion_max"} <= ours & after.keys()
    assert "good" in {before[name] for name in ours}
    assert "good" not in {after[name] for name in ours & after.keys()}
    assert [(n, g) for n, g in after.items() if n not in ours] == [
        (n, g) for n, g in before.items() if n not in ours
    ]
    assert wrong_segments(checked) == {*CHAINS["index"]}


def test_standard_deviations_of_the_whole_finger_are_wide_and_those_of_the_others_as_they_were() -> (
    None
):
    made, checked = by_ekf()
    before, after = made.trajectory.angles_sd, checked.trajectory.angles_sd
    assert before is not None and after is not None
    assert np.degrees(before[:, JOINT["index_mcp"]][:, IS_DOF[JOINT["index_mcp"]]]).mean() < 20.0
    for k in INDEX:
        assert (after[:, k][:, IS_DOF[k]] > np.radians(20.0)).all()
    np.testing.assert_array_equal(after[:, OTHERS], before[:, OTHERS])


def test_where_sensors_are_not_coupled_only_the_faulty_one_is_flagged() -> None:
    checked = check_processed(process(m2, m2.Params(), negated()), negated())
    assert wrong_segments(checked) == {FAULTY}
    assert not (checked.trajectory.flags[:, CHILDREN] & Flag.DOUBTFUL).any()


def test_the_hands_sensor_takes_all_fingers_with_it() -> None:
    assert wrong_segments(by_ekf("hand")[1]) == {s for s in ALL if s != "forearm"}


def test_nothing_changes_where_nothing_is_found() -> None:
    made = of_intact()
    flags, sd = made.trajectory.flags.copy(), made.trajectory.angles_sd
    checked = check_processed(made, intact())
    assert not checked.findings
    np.testing.assert_array_equal(checked.trajectory.flags, flags)
    np.testing.assert_array_equal(checked.trajectory.angles_sd, sd)


@pytest.mark.parametrize(
    ("sensors", "severity", "segments"),
    [
        (("ring_middle", "ring_distal"), "warning", CHAINS["ring"]),  # exchanged
        (CHAINS["ring"] + CHAINS["index"], "warning", CHAINS["ring"] + CHAINS["index"]),
        (("hand", "ring_proximal"), "warning", (*CHAINS["ring"], "hand")),  # their joint
        (("hand", "ring_proximal"), "fault", [s for s in ALL if s != "forearm"]),
        (("forearm",), "fault", ("forearm",)),
    ],
)
def test_what_a_finding_reaches(
    monkeypatch: pytest.MonkeyPatch,
    sensors: Sequence[str],
    severity: str,
    segments: Sequence[str],
) -> None:
    made = of_intact()
    message = Message("sensors.exchanged", {"first": "a", "second": "b", "odds": 1e6}, severity)  # type: ignore[arg-type]
    span = (-np.inf, np.inf)
    monkeypatch.setattr(
        check, "suspicions_of", lambda *_: [Suspicion(message, tuple(sensors), (span,), 0.0)]
    )
    assert wrong_segments(check_processed(made, intact())) == {*segments}


def test_a_fault_is_remembered_until_the_filter_starts_anew() -> None:
    poses = (5.0, 30.0)
    assert remembered((8.0, 9.0), poses) == (8.0, 30.0)
    assert remembered((31.0, 32.0), poses) == (31.0, np.inf)
    assert remembered((1.0, 2.0), poses) == (-np.inf, 2.0)  # run backwards from the first pose
    assert remembered((1.0, 6.0), poses) == (-np.inf, 30.0)
    assert remembered((8.0, 9.0), ()) == (-np.inf, np.inf)  # solved at once


@pytest.mark.parametrize(
    ("name", "restarts"),
    [
        ("b", None),
        ("m1", None),
        ("m2", None),
        ("ekf", (1.0, 9.0)),
        ("map-live", (1.0, 9.0)),
        ("map", ()),
    ],
)
def test_which_methods_couple_sensors(name: str, restarts: tuple[float, ...] | None) -> None:
    (calibration,) = calibrate(ekf.Params(), intact())[0]
    poses = [replace(calibration, t=t) for t in (1.0, 9.0)]
    assert restarts_of(ALL_METHODS[name].CAPABILITIES, poses) == restarts


def test_a_joint_of_hand_and_finger_is_not_the_hands_sensor() -> None:
    assert coupled_segments(("hand", "ring_proximal")) == [*CHAINS["ring"]]
