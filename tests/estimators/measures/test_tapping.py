"""Finger tapping on synthetic distances with known taps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import tapping
from handscope.estimators.measures.tapping import Params, Tapping
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL

RATE, ONSET = 200.0, 1.0


def _distance(
    closings: np.ndarray, amplitudes: np.ndarray, drift: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Raised cosines between the closings, open by 40 mm before and after; `drift` in m/s."""
    t = np.arange(0, closings[-1] + 1.0, 1 / RATE)
    d = np.full(len(t), 0.010)
    for a, b, amplitude in zip(closings[:-1], closings[1:], amplitudes):
        inside = (t >= a) & (t <= b)
        d[inside] += amplitude * 0.5 * (1 - np.cos(2 * np.pi * (t[inside] - a) / (b - a)))
    for outside, edge in ((t < closings[0], closings[0]), (t > closings[-1], closings[-1])):
        d[outside] += 0.04 * (1 - np.exp(-(((t[outside] - edge) / 0.1) ** 2)))
    return t, d + drift * t


def _moved(t: np.ndarray, d: np.ndarray) -> Trajectory:
    tips = np.zeros((len(t), 5, 3))
    tips[:, 1, 1] = d
    return replace(
        trajectory.empty("left"),
        t=t,
        angles=np.zeros((len(t), len(JOINTS), 3)),
        q_GS=np.zeros((len(t), len(SEGMENTS), 4)),
        tips=tips,
        flags=np.zeros((len(t), len(SEGMENTS)), np.uint8),
    )


def _measured(closings: np.ndarray, amplitudes: np.ndarray, drift: float = 0.0) -> Tapping:
    moved = _moved(*_distance(closings, amplitudes, drift))
    return tapping.measure(Params(), moved, float(closings[0]), float(closings[-1]))


@given(
    st.lists(st.tuples(st.floats(0.2, 0.8), st.floats(0.03, 0.09)), min_size=2, max_size=20),
    st.sampled_from([0.0, 0.002, -0.0005]),
)
@example(
    [
        (0.53125, 0.0625),
        (0.509765625, 0.0625),
        (0.387205065004955, 0.0625),
        (0.697265625, 0.03),
        (0.201171875, 0.078125),
    ],
    0.0,
)
def test_known_taps_are_found_with_their_times_amplitudes_and_speeds(
    drawn: list[tuple[float, float]], drift: float
) -> None:
    intervals, amplitudes = np.array(drawn).T
    closings = ONSET + np.concatenate([[0], np.cumsum(intervals)])
    found = _measured(closings, amplitudes, drift)
    assert found.count == len(amplitudes)
    # a sample, and what the low-pass smears where a slow small tap meets a fast wide one
    np.testing.assert_allclose(
        found.closings, closings, atol=1 / RATE + 1 / (2 * np.pi * Params().lowpass)
    )
    np.testing.assert_allclose(found.amplitudes, amplitudes, atol=0.5e-3 + 0.01 * amplitudes.max())
    peaks = np.pi * amplitudes / intervals
    np.testing.assert_allclose(found.opening_speeds, peaks, rtol=0.05)
    np.testing.assert_allclose(found.closing_speeds, peaks, rtol=0.05)
    assert found.rate == pytest.approx(
        len(amplitudes) / intervals.sum(), rel=0.01 + 2 / RATE / intervals.sum()
    )  # a sample at either end
    assert found.grade == "good"


def test_the_decrement_is_the_slope_of_amplitude_and_the_ratio_of_the_ends() -> None:
    amplitudes = 0.06 - 0.002 * np.arange(12)
    found = _measured(ONSET + 0.4 * np.arange(13), amplitudes)
    assert found.decrement_slope == pytest.approx(-0.002, rel=0.01)
    assert found.decrement_ratio == pytest.approx(
        (amplitudes[-5:].mean() - amplitudes[:5].mean()) / amplitudes[:5].mean(), rel=0.01
    )


def test_fewer_than_eight_taps_have_no_decrement_and_say_so() -> None:
    found = _measured(ONSET + 0.4 * np.arange(8), np.full(7, 0.05))
    assert found.count == 7
    assert np.isnan([found.decrement_slope, found.decrement_ratio]).all()
    reasons = {f.name: f.reason for f in tapping.figures(found)}
    assert (
        reasons["tapping_decrement_slope"]
        == reasons["tapping_decrement_ratio"]
        == "too few movements for a decrement"
    )
    assert reasons["tapping_count"] == ""


def test_rhythm_is_the_coefficient_of_variation_with_the_sample_sd() -> None:
    intervals = np.array([0.3, 0.4, 0.5, 0.4, 0.3, 0.5])
    found = _measured(ONSET + np.concatenate([[0], np.cumsum(intervals)]), np.full(6, 0.05))
    figures = {f.name: f.value for f in tapping.figures(found)}
    assert figures["tapping_interval_cv"] == pytest.approx(
        intervals.std(ddof=1) / intervals.mean(), rel=0.03
    )
    assert figures["tapping_interval_mean"] == pytest.approx(0.4, abs=2 / RATE)
    assert figures["tapping_amplitude_cv"] < 0.02


def test_taps_outside_the_trial_do_not_count() -> None:
    closings = ONSET + 0.5 * np.arange(11)
    moved = _moved(*_distance(closings, np.full(10, 0.05)))
    assert tapping.measure(Params(), moved, closings[2], closings[6]).count == 4
    assert tapping.measure(Params(), moved, closings[2] + 0.2, closings[6] - 0.2).count == 2


def _rested(taps: int, rate: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Taps of 60 mm from 2 s on; before and after them the fingers rest together."""
    t = np.arange(0, 4 + taps / rate, 0.01)
    tapped = (t >= 2) & (t < 2 + taps / rate)
    d = 0.01 + 0.03 * (1 - np.cos(2 * np.pi * rate * (t - 2))) * tapped
    return t, d + rng.normal(0, 2e-4, len(t))


@pytest.mark.parametrize(("taps", "rate"), [(3, 1.0), (10, 2.0), (20, 2.5), (15, 4.0)])
def test_a_hand_that_rests_before_and_after_has_all_its_taps(taps: int, rate: float) -> None:
    t, d = _rested(taps, rate, np.random.default_rng(taps))
    for margin in (0.0, 0.2, 0.5, 1.0):
        found = tapping.measure(Params(), _moved(t, d), 2 - margin, 2 + taps / rate + margin)
        assert found.count == taps
        assert found.rate == pytest.approx(rate, rel=0.05)
    found = tapping.of_distance(t, d)
    assert (found.count, found.taps and found.taps.count_sd) == (taps, 0.0)
    np.testing.assert_allclose(found.closings[[0, -1]], [2, 2 + taps / rate], atol=0.06)


def test_a_recording_that_begins_within_a_tap_begins_with_the_next() -> None:
    t, d = _rested(10, 2.0, np.random.default_rng(0))
    cut = (t > 2.1) & (t < 6.85)
    assert tapping.of_distance(t[cut], d[cut]).count == 8


def test_a_rest_with_open_fingers_is_no_closing() -> None:
    """The fingers rest 30 mm apart, tap, and rest so again."""
    t, d = _rested(10, 2.0, np.random.default_rng(0))
    d[(t < 2.25) | (t > 6.75)] = np.maximum(d, 0.04)[(t < 2.25) | (t > 6.75)]
    assert tapping.of_distance(t, d).count == 8


def test_shallow_dips_within_an_opening_are_no_closings() -> None:
    t, d = _distance(ONSET + 1.0 * np.arange(6), np.full(5, 0.05))
    d += 0.004 * np.sin(2 * np.pi * 7 * t)
    found = tapping.measure(Params(), _moved(t, d), ONSET, ONSET + 5)
    assert found.count == 5


@pytest.mark.parametrize("still", [0.0, 0.004])
def test_a_hand_that_does_not_tap_has_no_taps_and_a_reason(still: float) -> None:
    t = np.arange(0, 10, 1 / RATE)
    found = tapping.measure(Params(), _moved(t, 0.03 + 0.5 * still * np.sin(5 * t)), 1.0, 9.0)
    assert found.count == 0
    assert found.grade == "poor"
    assert found.reason == "no complete tap found"
    values = {f.name: f.value for f in tapping.figures(found)}
    assert values.pop("tapping_count") == 0
    assert np.isnan(list(values.values())).all()


def test_a_finger_that_was_not_measured_is_the_reason() -> None:
    moved = _moved(*_distance(ONSET + 0.5 * np.arange(6), np.full(5, 0.05)))
    moved.tips[:, 0] = np.nan
    found = tapping.measure(Params(), moved, 1.0, 3.0)
    assert found.reason == "thumb or index finger not measured"
    assert (
        tapping.measure(Params(), moved, 100.0, 110.0).reason
        == "thumb or index finger not measured"
    )


def test_bridged_samples_lower_the_grade() -> None:
    moved = _moved(*_distance(ONSET + 0.5 * np.arange(21), np.full(20, 0.05)))
    moved.flags[500:600, SEGMENT["thumb_distal"]] = Flag.MISSING
    found = tapping.measure(Params(), moved, 1.0, 11.0)
    assert (found.grade, found.count) == ("fair", 20)
    moved.flags[:, SEGMENT["little_distal"]] = Flag.HEADING_LOST  # not a finger that taps
    assert tapping.measure(Params(), moved, 1.0, 11.0).grade == "fair"


@pytest.mark.parametrize("rate", [2.5])
def test_the_simulated_patient_taps_as_often_as_the_task_says(rate: float) -> None:
    recording = simulate(["tapping"], "right", sized("right"), np.random.default_rng(1), IDEAL)
    (task,) = recording.events
    found = tapping.measure(Params(), recording.truth, task.onset, task.end)
    assert found.count == int(15 * rate)
    assert found.rate == pytest.approx(rate, rel=0.01)
    assert found.amplitudes.std() < 1e-3


def test_the_measure_applies_to_tapping_tasks() -> None:
    assert tapping.applies("Finger tapping 15 s")
    assert not tapping.applies("rom")
