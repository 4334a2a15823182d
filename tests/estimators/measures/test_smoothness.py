"""Smoothness against the published test vectors, and what it must not depend on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.estimators.measures.smoothness import (
    dimensionless_jerk,
    log_dimensionless_jerk,
    movement_units,
    sparc,
)

SPEED = np.exp(-5 * np.arange(-1, 1, 0.01) ** 2)


def test_the_published_vectors_come_out_to_the_last_digit() -> None:
    """siva82kb/SPARC, scripts/smoothness.py @3650934."""
    assert f"{sparc(SPEED, 100.0):.5f}" == "-1.41403"
    assert f"{dimensionless_jerk(SPEED, 100.0):.5f}" == "-335.74684"
    assert f"{log_dimensionless_jerk(SPEED, 100.0):.5f}" == "-5.81636"


@given(st.floats(1e-3, 1e3))
def test_the_size_of_a_movement_does_not_count(size: float) -> None:
    assert sparc(size * SPEED, 100.0) == pytest.approx(sparc(SPEED, 100.0), rel=1e-9)
    assert log_dimensionless_jerk(size * SPEED, 100.0) == pytest.approx(
        log_dimensionless_jerk(SPEED, 100.0), rel=1e-9
    )


def test_the_jerk_of_a_movement_does_not_count_how_long_it_took() -> None:
    assert dimensionless_jerk(SPEED, 50.0) == pytest.approx(
        dimensionless_jerk(SPEED, 100.0), rel=1e-9
    )


def test_a_minimum_jerk_movement_has_the_jerk_of_its_closed_form() -> None:
    """Speed 30 (s^2 - 2 s^3 + s^4): its second derivative squared integrates to 720, its peak is 15/8."""
    s = np.linspace(0, 1, 4001)
    assert dimensionless_jerk(30 * (s**2 - 2 * s**3 + s**4), 4000.0) == pytest.approx(
        -720 / (15 / 8) ** 2, rel=2e-3
    )


def test_a_movement_in_two_pieces_is_less_smooth() -> None:
    pieces = np.concatenate([SPEED, SPEED])
    assert sparc(pieces, 100.0) < sparc(SPEED, 100.0) - 0.5
    assert log_dimensionless_jerk(pieces, 100.0) < log_dimensionless_jerk(SPEED, 100.0) - 1


def test_jerk_and_acceleration_may_be_given_instead_of_the_speed() -> None:
    t = np.arange(0, 1, 1e-4)
    acceleration = np.sin(2 * np.pi * t)  # mean square of its slope is (2 pi)^2 / 2 over 1 s
    assert dimensionless_jerk(acceleration, 1e4, "acceleration") == pytest.approx(
        -((2 * np.pi) ** 2) / 2, rel=1e-3
    )
    assert dimensionless_jerk(acceleration, 1e4, "jerk") == pytest.approx(-0.5, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "rate", "words"),
    [
        ([1.0, 2.0], 100.0, "at least 3 samples"),
        ([1.0, np.nan, 2.0, 1.0], 100.0, r"samples of the movement are not numbers \(1\)"),
        ([1.0, 2.0, 1.0], 0.0, "samples per second"),
        ([[1.0, 2.0, 1.0]], 100.0, "shape"),
    ],
)
def test_what_is_no_movement_is_refused_in_words(
    speed: list[float], rate: float, words: str
) -> None:
    for measure in (sparc, log_dimensionless_jerk):
        with pytest.raises(InputError, match=words):
            measure(np.array(speed), rate)


def test_a_hand_that_rests_has_no_smoothness() -> None:
    assert np.isnan(sparc(np.zeros(100), 100.0))
    assert np.isnan(log_dimensionless_jerk(np.zeros(100), 100.0))


def test_movement_units_are_peaks_that_rise_far_enough_and_late_enough() -> None:
    """At 100 Hz a bell of 300 mm/s and, on its way down, another: by 40 mm/s, by 15, and 100 ms after the first."""
    t = np.arange(0, 1.5, 0.01)

    def bell(at: float, height: float, width: float) -> np.ndarray:
        return np.asarray(height * np.exp(-(((t - at) / width) ** 2)))

    assert movement_units(bell(0.5, 0.3, 0.2), 100.0, 0.02, 0.15) == 1
    assert movement_units(bell(0.5, 0.3, 0.15) + bell(1.1, 0.04, 0.08), 100.0, 0.02, 0.15) == 2
    assert movement_units(bell(0.5, 0.3, 0.15) + bell(1.1, 0.015, 0.08), 100.0, 0.02, 0.15) == 1
    near = bell(0.5, 0.3, 0.04) + bell(0.6, 0.3, 0.04)
    assert movement_units(near, 100.0, 0.02, 0.15) == 1 < movement_units(near, 100.0, 0.02, 0.05)
