"""From a recording to the hand's movement: which calibration is taken, and what is said about it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import accelerometer_bias
from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.methods import ekf, m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import DEG, INSTANT, assert_same, pose_and_wiggle, tracked, with_samples

PARAMS = INSTANT
TOO_SHORT = Event(2.0, 1.0, "initial_pose")


def _without_pose(recording: Simulated) -> Simulated:
    """What is left from the middle of the pose on, and nothing that says so."""
    later = with_samples(
        recording, {name: b.between(2.0, np.inf) for name, b in recording.samples.items()}
    )
    return replace(later, events=(), truth=recording.truth.between(2.0, np.inf))


def test_the_initial_pose_is_found_by_itself(simulated: Simulated) -> None:
    done = process(m2, PARAMS, simulated)
    assert_same(done.trajectory, tracked(simulated))
    assert [c.source for c in done.calibrations] == ["initial pose"]
    assert done.warnings == ()


def test_progress_grows_to_the_whole() -> None:
    shares: list[float] = []
    process(m2, PARAMS, pose_and_wiggle("left"), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_a_bad_pose_beside_a_good_one_is_a_warning() -> None:
    recording = pose_and_wiggle("left")
    done = process(m2, PARAMS, replace(recording, events=(*recording.events, TOO_SHORT)))
    assert len(done.calibrations) == 1
    assert "1.0 s of samples" in done.warnings[0]


def test_a_recording_whose_only_pose_is_bad_is_refused_with_its_fault() -> None:
    with pytest.raises(InputError, match=r"1\.0 s of samples"):
        process(m2, PARAMS, replace(pose_and_wiggle("left"), events=(TOO_SHORT,)))


def test_a_recording_without_a_pose_is_refused_with_what_to_do() -> None:
    with pytest.raises(
        InputError,
        match="no initial_pose event; record 3 s of it, or take that of another recording",
    ):
        process(m2, PARAMS, _without_pose(pose_and_wiggle("left")))


def test_the_pose_may_come_from_another_recording() -> None:
    recording = _without_pose(pose_and_wiggle("left"))
    done = process(m2, PARAMS, recording, pose_and_wiggle("left"))
    assert np.nanmax(np.abs(done.trajectory.angles - recording.truth.angles)) < 0.5 * DEG
    assert done.calibrations[0].source == "another recording"
    assert any("begins in the pose" in w for w in done.warnings)


@pytest.mark.parametrize("named", [94.0, 103.0])
def test_a_rate_that_the_recording_names_wrongly_is_measured_and_said(named: float) -> None:
    recording = pose_and_wiggle("left")
    wrong = {
        name: Block(replace(b.stream, rate=named), b.t, b.values)
        for name, b in recording.samples.items()
    }
    done = process(m2, PARAMS, with_samples(recording, wrong))
    assert np.nanmax(np.abs(done.trajectory.angles - recording.truth.angles)) < 0.5 * DEG
    assert any(f"come at 100 Hz and not at {named:g}" in w for w in done.warnings)


def test_a_pose_of_the_other_hand_is_refused() -> None:
    with pytest.raises(InputError, match="right hand, the recording of the left"):
        process(m2, PARAMS, _without_pose(pose_and_wiggle("left")), pose_and_wiggle("right"))


def test_what_was_missing_lost_or_at_its_limit_is_told_by_segment() -> None:
    recording = pose_and_wiggle("left")
    imu = recording.samples["imu"]
    values = imu.values.copy()
    names = imu.stream.sensors
    values[1000:1005, [names.index("ring_middle"), names.index("ring_distal")]] = np.nan
    values[1100:1200, names.index("little_distal")] = np.nan
    values[900, names.index("thumb_distal"), 0] = imu.stream.full_scale["gyr"]
    done = process(
        m2,
        PARAMS,
        with_samples(recording, {**recording.samples, "imu": Block(imu.stream, imu.t, values)}),
    )
    assert set(done.warnings) == {
        "thumb_distal: sensor at its limit in 0.1 % of the samples",
        "ring_middle, ring_distal: samples missing and bridged in 0.4 % of the samples",
        "little_distal: samples missing and bridged in 7.0 % of the samples",
        "little_distal: heading lost after a gap in 8.5 % of the samples",
    }


def test_seats_and_lengths_found_before_serve_a_pose() -> None:
    skewed = replace(IDEAL, misalignment=8.0)
    worn = pose_and_wiggle("left", skewed)
    told = ("index_proximal", "index_middle")
    mounting = {s: worn.sensors.q_BS[worn.sensors.segments.index(s)] for s in told}
    longer = {s: 1.1 * worn.geometry.lengths[s] for s in told}
    seats_sd, lengths_sd = dict.fromkeys(told, np.full(3, 0.01)), dict.fromkeys(told, 2e-4)
    known = PriorCalibration("left", mounting, {}, longer, seats_sd, lengths_sd)
    done = process(m2, PARAMS, worn, known=known).calibrations[0]
    for s in told:
        assert quat.angle(quat.relative(done.q_BS[s], mounting[s])) < 1e-9
        assert done.geometry.lengths[s] == longer[s]
    assert done.geometry.lengths["ring_middle"] == worn.geometry.lengths["ring_middle"]
    assert done.q_BS_sd == seats_sd and done.lengths_sd == lengths_sd
    assert "self-calibration" in done.description


def test_accelerometer_biases_found_before_are_taken_off() -> None:
    """The angles are those of accelerometers without biases, within 0.05 deg; left in they cost ten times as much."""
    worn, rng = pose_and_wiggle("left"), np.random.default_rng(2)
    biases = {s: rng.normal(0, 0.1, 3) for s in SEGMENTS}
    spoilt = with_samples(worn, {n: _biased(b, biases) for n, b in worn.samples.items()})
    mounting = dict(zip(worn.sensors.segments, worn.sensors.q_BS))
    known = PriorCalibration(
        "left", mounting, {}, {}, dict.fromkeys(mounting, np.full(3, 0.005)), {}, acc_bias=biases
    )
    right, taken_off, left_in = (
        process(ekf, ekf.Params(), recording, known=one).trajectory.angles
        for recording, one in (
            (worn, replace(known, acc_bias={})),
            (spoilt, known),
            (spoilt, replace(known, acc_bias={})),
        )
    )
    off, without = (np.degrees(np.nanmax(np.abs(a - right))) for a in (taken_off, left_in))
    assert off < 0.05 and without > 10 * off


def _biased(block: Block, biases: Mapping[str, Array]) -> Block:
    return accelerometer_bias.subtract(block, {s: -b for s, b in biases.items()})


def test_what_was_found_of_the_other_hand_is_refused() -> None:
    with pytest.raises(InputError, match="of the right hand, the recording of the left"):
        process(
            m2, PARAMS, pose_and_wiggle("left"), known=PriorCalibration("right", {}, {}, {}, {}, {})
        )
