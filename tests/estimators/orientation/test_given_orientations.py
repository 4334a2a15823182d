"""Orientations that a device computed itself, against our own fusion exported as such."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handscope.estimators.alignment import quality
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.methods import b, default_for, ekf, m1, m2
from handscope.estimators.methods import map as self_calibrated
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.orientation import given_orientations
from handscope.estimators.pipeline.process import process
from tests.oriented import fused, oriented_strips
from tests.simulated import DEG, INSTANT, cut, in_strips, with_samples


@pytest.mark.parametrize("hand", ["left", "right"])
def test_from_the_pose_on_angles_are_those_of_our_own_fusion(hand: str) -> None:
    recording = in_strips(hand)
    done = process(m2, INSTANT, recording)
    pose = done.calibrations[0].t
    ours = done.trajectory.between(pose, np.inf)
    result = process(m2, INSTANT, oriented_strips(hand)).trajectory.between(pose, np.inf)
    np.testing.assert_array_equal(result.t, ours.t)
    np.testing.assert_array_equal(result.flags, ours.flags)
    assert np.nanmax(np.abs(result.angles - ours.angles)) < 0.1 * DEG
    assert np.nanmax(np.abs(result.tips - ours.tips)) < 0.5e-3


def test_b_takes_the_headings_of_the_device_as_they_are() -> None:
    recording = fused(in_strips("left"), headings=0.0)
    result = process(b, b.Params(), recording).trajectory
    assert not (result.flags & Flag.UNCALIBRATED).any()
    late = result.between(5.0, np.inf)
    truth = recording.truth.between(5.0, np.inf)
    flexion = np.abs(late.angles[..., 0] - truth.angles[..., 0])
    assert np.nanmedian(flexion) < 5 * DEG


def test_m1_takes_them_without_magnetometers() -> None:
    recording = oriented_strips("left")
    result = process(m1, m1.Params(), recording).trajectory.between(3.0, np.inf)
    truth = recording.truth.between(3.0, np.inf)
    assert np.nanmax(np.abs(result.angles - truth.angles)) < 1.0 * DEG


@pytest.mark.parametrize("method", [ekf, self_calibrated])
def test_a_method_that_needs_rates_says_so(method: object) -> None:
    params = method.Params()  # type: ignore[attr-defined]
    with pytest.raises(InputError, match="orientations alone; use m2"):
        process(method, params, oriented_strips("left"))  # type: ignore[arg-type]


def test_raw_samples_of_the_same_sensor_go_first() -> None:
    raw = in_strips("left")
    beside = {f"{n}_orientation": _named(b) for n, b in fused(raw).samples.items()}
    both = process(m2, INSTANT, with_samples(raw, {**raw.samples, **beside}))
    ours = process(m2, INSTANT, raw)
    np.testing.assert_array_equal(both.trajectory.angles, ours.trajectory.angles)
    assert both.warnings == ours.warnings


def _named(block: Block) -> Block:
    return replace(block, stream=replace(block.stream, name=f"{block.stream.name}_orientation"))


def test_error_bars_come_from_the_stated_accuracy() -> None:
    done = process(m2, replace(INSTANT, orientation_sd=2.0), oriented_strips("left"))
    sd = done.trajectory.angles_sd
    assert sd is not None
    assert np.nanmax(sd) == pytest.approx(np.sqrt(2) * 2 * DEG)
    np.testing.assert_array_equal(np.isfinite(sd), np.isfinite(done.trajectory.angles))
    assert any("own fusion" in w and "stated 2 deg" in w for w in done.warnings)


def test_error_bars_come_from_a_pose_that_was_repeated() -> None:
    recording = oriented_strips("left")
    pose = next(e for e in recording.events if e.trial_type == "initial_pose")
    end = max(float(b.t[-1]) for b in recording.samples.values())
    drift = 2 * DEG
    samples = {
        n: _repeated(b, pose, end, drift * (n == "index")) for n, b in recording.samples.items()
    }
    again = replace(pose, onset=pose.onset + end + 1.0)
    done = process(
        m2, INSTANT, replace(with_samples(recording, samples), events=(*recording.events, again))
    )
    # three of the 16 sensors beside the hand's turned by 2 deg
    expected = np.sqrt(3 * drift**2 / (3 * 16) / 4)
    assert done.calibrations[0].orientation_sd == pytest.approx(expected, rel=0.05)
    assert any("2 poses" in w for w in done.warnings)


def _repeated(block: Block, pose: Event, end: float, turn: float) -> Block:
    """The samples, and the pose's once more, turned about the vertical."""
    part = block.between(0.0, pose.end + 0.5)
    later = quat.turn_heading(part.values, turn)
    return Block(
        block.stream,
        np.concatenate([block.t, part.t + end + 1.0]),
        np.concatenate([block.values, later]),
    )


def test_without_accuracy_and_repetition_there_are_no_error_bars() -> None:
    done = process(m2, INSTANT, oriented_strips("left"))
    assert done.trajectory.angles_sd is None
    assert any("there are no error bars" in w for w in done.warnings)


def test_a_missing_orientation_is_the_one_before_and_flagged() -> None:
    recording = oriented_strips("left")
    index = recording.samples["index"]
    values = index.values.copy()
    values[700:720, 1] = np.nan
    values[800:810, 1] = 0.0
    spoilt = {**recording.samples, "index": Block(index.stream, index.t, values)}
    done = process(m2, INSTANT, with_samples(recording, spoilt)).trajectory
    flagged = (done.flags[:, SEGMENT["index_middle"]] & Flag.MISSING) != 0
    assert flagged[700:720].all()
    assert flagged[800:810].all()
    assert flagged.sum() <= 34
    assert np.isfinite(done.angles[:, :, 0]).all()


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, 1419), max_size=6))
def test_blocks_may_be_cut_anywhere(where: list[int]) -> None:
    block = oriented_strips("left").samples["index"]
    whole = given_orientations.derive(block)
    parts, before = [], None
    for part in cut(block, where):
        parts.append(given_orientations.derive(part, before))
        before = part if len(part.t) else before
    np.testing.assert_array_equal(np.concatenate([p.values for p in parts]), whole.values)


def test_the_grade_says_that_the_fusion_was_not_ours() -> None:
    known = process(m2, INSTANT, oriented_strips("left")).calibrations[0]
    joints = {j.joint: j for j in quality.of_joints(known)}
    assert {(j.grade, j.reason) for j in joints.values()} == {("fair", "fusion")}


def test_the_default_method_is_one_that_takes_what_the_recording_has() -> None:
    assert default_for(in_strips("left").streams) == "ekf"
    assert default_for(oriented_strips("left").streams) == "m2"
    assert m2.CAPABILITIES.takes_orientations
