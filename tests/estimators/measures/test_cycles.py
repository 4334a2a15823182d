"""Cycles in plain arrays: analytic openings, sampled as real ones are - unevenly, with noise, holes, too short, too slow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.estimators.measures import repetitive_movement, tapping
from handscope.estimators.measures.cycles import Params
from handscope.estimators.measures.repetitive_movement import (
    OPEN_CLOSE,
    PRONATION_SUPINATION,
    Movement,
)
from handscope.estimators.messages.sentence import codes_of
from tests.estimators.measures.trajectories import by_name

DEG = np.pi / 180


def _opening(t: np.ndarray, rate: float, amplitude: float, start: float = 0.5) -> np.ndarray:
    """Raised cosine from `start` on, open before."""
    return np.where(t < start, 1.0, 0.5 * (1 - np.cos(2 * np.pi * rate * (t - start)))) * amplitude


def _values(trial: tapping.Tapping) -> dict[str, float]:
    return {name: f.value for name, f in by_name(tapping.figures(trial)).items()}


@given(
    st.floats(0.8, 5.0),
    st.floats(15, 110),
    st.sampled_from([30.0, 60.0, 200.0]),
    st.integers(0, 2**32 - 1),
)
def test_a_noisy_camera_with_uneven_frames_tells_rate_and_amplitude(
    rate: float, amplitude: float, fps: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(0, 15, 1 / fps)
    t = t + rng.uniform(-0.2, 0.2, len(t)) / fps
    angle = _opening(t, rate, amplitude * DEG) + rng.normal(0, 0.02 * amplitude * DEG, len(t))
    angle[rng.random(len(t)) < 0.02] = np.nan
    found = tapping.of_angle(t, angle)
    v = _values(found)
    assert v["tapping_rate"] == pytest.approx(rate, rel=0.03)
    assert v["tapping_angle_amplitude_mean"] == pytest.approx(
        amplitude * DEG, rel=0.25 if fps == 30 else 0.12
    )
    assert abs(found.count - rate * 14.5) <= 2


def test_a_distance_and_its_angle_tell_the_same_taps() -> None:
    t = np.arange(0, 10, 0.005)
    distance, angle = (
        tapping.of_distance(t, _opening(t, 2.0, 0.06)),
        tapping.of_angle(t, _opening(t, 2.0, 60 * DEG)),
    )
    assert distance.count == angle.count == 18
    assert distance.amplitudes.mean() == pytest.approx(0.06, rel=0.01)
    assert _values(distance)["tapping_opening_speed_mean"] == pytest.approx(
        np.pi * 2.0 * 0.06, rel=0.03
    )
    freezes = by_name(tapping.figures(distance))["tapping_freezes"]
    assert np.isnan(freezes.value)  # a distance has no deg/s
    assert codes_of(freezes.reason) == {"measure.angle_needed"}
    assert _values(angle)["tapping_freezes"] == 0


def test_gyroscopes_mounted_anyhow_tell_the_angle_through_which_the_fingers_turn_apart() -> None:
    """Thumb 20, index 50 deg; a closing is more sudden than an opening."""
    rng = np.random.default_rng(3)
    t = np.arange(0, 12, 0.005)
    phase = (2.5 * t) % 1.0
    opening = np.where(
        phase < 0.6, np.sin(0.5 * np.pi * phase / 0.6), np.cos(0.5 * np.pi * (phase - 0.6) / 0.4)
    )
    slope = np.gradient(opening, t)
    axes = [a / np.linalg.norm(a) for a in rng.normal(size=(2, 3))]
    rates = [
        size * DEG * slope[:, None] * a + rng.normal(0, 0.01, (len(t), 3)) + 0.01
        for size, a in zip((20, 50), axes)
    ]
    found = tapping.of_rates(t, *rates)
    assert found.rate == pytest.approx(2.5, rel=0.01)
    assert found.amplitudes.mean() == pytest.approx(
        70 * DEG, rel=0.06
    )  # the low-pass rounds the cusps off
    assert found.closing_speeds.mean() > found.opening_speeds.mean()
    closed = np.interp(found.closings, t, opening)
    assert closed.max() < 0.25


def test_a_pause_is_an_interruption_or_a_freeze_by_how_long_it_lasts() -> None:
    """0.25 s and 0.5 s of standing still, at opening: the speed is below 50 deg/s a little longer than that."""
    t = np.arange(0, 12, 0.005)
    moving = np.ones(len(t))
    for start, length in ((4.25, 0.21), (7.0, 0.5)):
        moving[(t >= start) & (t < start + length)] = 0
    warped = np.cumsum(moving) * 0.005
    v = _values(tapping.of_angle(t, _opening(warped, 2.0, 60 * DEG, start=0.0)))
    assert (v["tapping_interruptions"], v["tapping_freezes"]) == (2, 1)
    assert v["tapping_longest_stop"] == pytest.approx(0.5, abs=0.1)


def test_taps_slower_than_the_speed_of_a_stop_have_no_freezes_and_say_so() -> None:
    """2.5 Hz of 3 and of 8 deg turn by at most 24 and 63 deg/s; there is no stop among them."""
    t = np.arange(0, 10, 0.01)
    params = Params(smallest_turn=2 * DEG)
    for trial, prefix, measure in (
        (tapping.of_angle(t, _opening(t, 2.5, 3 * DEG), params), "tapping", tapping),
        (
            repetitive_movement.of_turn(t, _opening(t, 2.5, 3 * DEG), params),
            "open_close",
            OPEN_CLOSE,
        ),
    ):
        f = by_name(measure.figures(trial))  # type: ignore[arg-type]
        for what in ("interruptions", "freezes", "longest_stop"):
            figure = f[f"{prefix}_{what}"]
            assert np.isnan(figure.value)
            assert figure.grade == "poor"
            assert "slower than 50 deg/s" in figure.reason
        assert "freeze" not in measure.shown(trial).marks  # type: ignore[arg-type]
        assert f[f"{prefix}_count"].grade == "good"
    assert _values(tapping.of_angle(t, _opening(t, 2.5, 8 * DEG)))["tapping_freezes"] == 0


def test_decrement_and_fatigue_are_those_put_in() -> None:
    """Intervals from 0.3 s on, 10 ms longer each; amplitudes 60 deg, 1 deg less each."""
    intervals = 0.3 + 0.01 * np.arange(20)
    closed = 0.5 + np.concatenate([[0], np.cumsum(intervals)])
    t = np.arange(0, closed[-1] + 0.5, 0.005)
    angle = np.full(len(t), 20 * DEG)
    for k, (a, b) in enumerate(zip(closed[:-1], closed[1:])):
        inside = (t >= a) & (t <= b)
        angle[inside] = (60 - k) * DEG * 0.5 * (1 - np.cos(2 * np.pi * (t[inside] - a) / (b - a)))
    f = by_name(tapping.figures(tapping.of_angle(t, angle)))
    assert f["tapping_count"].value == 20
    assert f["tapping_angle_decrement_slope"].value == pytest.approx(-DEG, rel=0.03)
    assert f["tapping_interval_slope"].value == pytest.approx(0.01, rel=0.05)
    assert f["tapping_angle_first_amplitude_mean"].value == pytest.approx(55.5 * DEG, rel=0.02)
    assert f["tapping_first_rate"].value == pytest.approx(10 / intervals[:10].sum(), rel=0.01)
    for percent, n in ((10, 2), (25, 5), (50, 10)):
        assert f[f"tapping_fatigue{percent}"].value == pytest.approx(
            intervals[:n].mean() - intervals[-n:].mean(), abs=0.01
        )
    assert f["tapping_angle_half_decrement"].value == pytest.approx(10 * DEG, rel=0.03)


def test_slopes_have_their_standard_errors() -> None:
    """The spread of the slope over many noisy trials is what a single one says."""
    rng = np.random.default_rng(5)
    params, slopes, said = Params(), [], []
    from handscope.estimators.measures.cycle_figures import _slope

    for _ in range(400):
        slope, error = _slope(params, 60 + rng.normal(0, 5, 20))
        slopes.append(slope)
        said.append(error)
    assert np.std(slopes) == pytest.approx(np.sqrt(np.mean(np.square(said))), rel=0.1)


def test_a_hole_takes_its_cycles_out_and_says_so() -> None:
    t = np.arange(0, 15, 0.01)
    angle = _opening(t, 2.0, 60 * DEG)
    whole = tapping.of_angle(t, angle)
    kept = (t < 5) | (t > 7)
    cut = tapping.of_angle(t[kept], angle[kept])
    assert whole.count - cut.count in (5, 6)  # four within, and those that it cuts
    assert cut.rate == pytest.approx(whole.rate, rel=0.01)
    assert cut.grade == "fair"
    assert cut.reason == "13 % of the time without samples"
    as_nan = tapping.of_angle(t, np.where(kept, angle, np.nan))
    np.testing.assert_allclose(as_nan.amplitudes, cut.amplitudes, rtol=1e-6)


@pytest.mark.parametrize(
    ("t", "values", "words"),
    [
        ([0, 1, 2], [1, 2], "same length"),
        ([0, 2, 1], [1, 2, 3], "do not increase"),
        ([0, 1, 1], [1, 2, 3], "do not increase"),
        ([0, 1, np.nan], [1, 2, 3], "do not increase"),
        ([0, 1, 2], [1, np.inf, 3], "infinite"),
        ([0, 1, 2], [1, np.nan, np.nan], r"too few known samples \(1\)"),
        ([], [], r"too few known samples \(0\)"),
        (["a", "b"], [1, 2], "numbers"),
        ([[0, 1, 2]], [[1, 2, 3]], "shapes"),
    ],
)
def test_what_is_no_signal_is_refused_in_words(
    t: list[float], values: list[float], words: str
) -> None:
    for measure in (tapping.of_angle, tapping.of_distance):
        with pytest.raises(InputError, match=words):
            measure(np.array(t), np.array(values))


def test_rates_of_the_wrong_shape_are_refused_in_words() -> None:
    t = np.arange(100) / 100
    with pytest.raises(InputError, match="shapes"):
        tapping.of_rates(t, np.zeros((100, 3)), np.zeros((99, 3)))
    with pytest.raises(InputError, match="shapes"):
        tapping.of_rates(t, np.zeros((100, 2)), np.zeros((100, 2)))


@pytest.mark.parametrize("seconds", [0.1, 0.6, 2.0, 30.0])
def test_a_slow_or_short_recording_gives_few_taps_or_none_with_a_reason(seconds: float) -> None:
    t = np.arange(0, seconds, 0.01)
    found = tapping.of_angle(t, _opening(t, 0.4, 40 * DEG))
    f = by_name(tapping.figures(found))
    assert f["tapping_count"].value == found.count == (11 if seconds == 30 else 0)
    if not found.count:
        assert (found.grade, found.reason) == ("poor", "no complete tap found")
        assert np.isnan(f["tapping_rate"].value)
    else:
        assert f["tapping_rate"].value == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize(
    ("measure", "t", "size", "words"),
    [
        (tapping.of_angle, 1000.0, 1.0, "are the times in seconds"),  # milliseconds
        (tapping.of_angle, 1.0, 60.0, "give radians"),
        (tapping.of_distance, 1.0, 60.0, "give metres"),
        (repetitive_movement.of_turn, 1000.0, 1.0, "are the times in seconds"),
    ],
)
def test_other_units_than_asked_for_are_refused_in_words(
    measure: object, t: float, size: float, words: str
) -> None:
    seconds = np.arange(0, 10, 0.02)
    with pytest.raises(InputError, match=words):
        measure(seconds * t, _opening(seconds, 2.0, size))  # type: ignore[operator]


def test_taps_that_become_too_small_to_count_are_told() -> None:
    """60 deg falling to 3: the last fall below a quarter of the range, some of them still are above a tenth."""
    t = np.arange(0, 15, 0.01)
    found = tapping.of_angle(t, _opening(t, 3.0, 60 * DEG) * np.exp(-t / 5))
    assert found.count < 35
    assert found.grade == "fair"
    assert found.reason.endswith("movements of less than a quarter of the range are not counted")
    assert tapping.of_angle(t, _opening(t, 3.0, 60 * DEG)).reason == ""


def test_rates_that_are_not_known_are_refused() -> None:
    t = np.arange(0, 10, 0.01)
    with pytest.raises(InputError, match=r"both fingers' rates \(0\)"):
        tapping.of_rates(t, np.full((len(t), 3), np.nan), np.zeros((len(t), 3)))


def test_noise_alone_is_no_tapping() -> None:
    t = np.arange(0, 15, 0.01)
    noise = np.random.default_rng(0).normal(0, 1 * DEG, len(t))
    assert tapping.of_angle(t, noise).count == 0


@pytest.mark.parametrize(
    ("measure", "prefix"),
    [(OPEN_CLOSE, "open_close"), (PRONATION_SUPINATION, "pronation_supination")],
)
def test_fists_and_turns_are_described_in_the_same_terms(measure: Movement, prefix: str) -> None:
    t = np.arange(0, 15, 0.01)
    angle = _opening(t, 1.2, 150 * DEG)
    trial = (
        repetitive_movement.of_flexion(t, -angle)
        if measure is OPEN_CLOSE
        else repetitive_movement.of_turn(t, angle)
    )
    f = by_name(measure.figures(trial))
    assert f[f"{prefix}_rate"].value == pytest.approx(1.2, rel=0.01)
    assert f[f"{prefix}_amplitude_mean"].value == pytest.approx(150 * DEG, rel=0.01)
    assert f[f"{prefix}_interruptions"].value == 0
    nothing = measure.figures(repetitive_movement.of_turn(t, np.zeros(len(t))))
    values = {x.what: x.value for x in nothing}
    assert values.pop(f"{prefix}_count") == 0
    assert np.isnan(list(values.values())).all()
