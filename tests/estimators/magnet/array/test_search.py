"""A whole recording of an array: a second magnet is told from noise, and the movement from one reading to the next is no noise."""

import numpy as np

from handscope.estimators.magnet.array.recording_localisation import (
    LocalisationResult,
    locate_recording,
)
from handscope.estimators.magnet.array.search import Search
from handscope.estimators.magnet.model import setup as setup
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.magnetic_field import MagneticField

NOISE, CALIBRATION, FIELD = 0.2e-6, 0.1e-6, np.array([0.0, 18.6e-6, -46.2e-6])
PLACES = np.array([[x, y, 0.0] for x in (-0.06, -0.02, 0.02, 0.06) for y in (-0.04, 0.0, 0.04)])


def _recorded(n: int, rate: float, second: bool) -> tuple[Array, Array, Array]:
    """Times, readings (n, 12, 3) and places of a magnet that goes round before the array, another one a quarter of a metre away or none."""
    t = np.arange(n) / rate
    p = np.column_stack([0.05 * np.cos(3 * t), 0.05 * np.sin(2 * t), 0.11 + 0.02 * np.sin(1.3 * t)])
    m = 0.4 * np.column_stack([np.cos(t), np.sin(t), np.zeros(n)])
    off = np.column_stack([0.2 + 0.03 * np.sin(t), 0.1 * np.cos(t), np.full(n, 0.1)])
    other = np.column_stack([np.zeros(n), 0.3 * np.cos(t), 0.2 * np.sin(t)]) * second
    B = np.array(
        [
            MagneticField(FIELD, np.array(w), np.array(v)).at(PLACES)
            for w, v in zip(zip(p, off), zip(m, other))
        ]
    )
    return t, B + NOISE * np.random.default_rng(n).normal(size=B.shape), p


def _stamped_late(late: Array) -> tuple[Array, Array, Array]:
    """The same alone at 40 Hz for 3 s, readings of each magnetometer late by so many s (12,)."""
    t, rng = np.arange(120) / 40, np.random.default_rng(4)

    def at(t: Array) -> tuple[Array, Array]:
        p = np.column_stack(
            [0.05 * np.cos(3 * t), 0.05 * np.sin(2 * t), 0.11 + 0.02 * np.sin(1.3 * t)]
        )
        return p, 0.4 * np.column_stack([np.cos(t), np.sin(t), np.zeros(len(t))])

    each = [
        [
            MagneticField(FIELD, p[None], m[None]).at(PLACES[k : k + 1])[0]
            for p, m in zip(*at(t - tau))
        ]
        for k, tau in enumerate(late)
    ]
    mag = np.array(each).swapaxes(0, 1)
    return t, mag + NOISE * rng.normal(size=mag.shape), at(t)[0]


def _searched(t: Array, mag: Array, noise: float, places: Array = PLACES) -> LocalisationResult:
    return locate_recording(
        Search(t, mag, setup.make_constellation(places), noise, 0.0), None, 0.03, CALIBRATION
    )


def test_a_second_magnet_is_told_from_noise() -> None:
    t, mag, p = _recorded(40, 10.0, second=False)
    alone = _searched(t, mag, NOISE)
    assert alone.localisation.is_located.mean() > 0.9 and not alone.has_second_magnet.any()
    assert np.median(np.linalg.norm(alone.localisation.place - p, axis=1)) < 0.002
    t, mag, _ = _recorded(40, 10.0, second=True)
    both = _searched(t, mag, NOISE)
    assert both.has_second_magnet.mean() > 0.6 and not both.localisation.is_located.any()


def test_movement_from_one_reading_to_the_next_is_no_noise() -> None:
    """A magnet that is put to one place after another, as on a robot: differences of readings say 10 uT, what places leave says what the noise is."""
    t, mag, p = _recorded(40, 1.0, second=False)
    found = _searched(t, mag, 10e-6)
    np.testing.assert_allclose(found.search.noise, NOISE, rtol=0.25)
    assert found.localisation.is_located.mean() > 0.9
    square = (((found.localisation.place - p) / found.localisation.place_sd) ** 2)[
        found.localisation.is_located
    ]
    assert 0.5 < square.mean() < 1.5


def test_a_few_places_before_five_magnetometers_tell_the_noise_too() -> None:
    """One reading a place, as a bench without a robot has it."""
    t, mag, p = _recorded(12, 1.0, second=False)
    five = [0, 2, 4, 9, 11]
    found = _searched(t, mag[:, five], 10e-6, PLACES[five])
    np.testing.assert_allclose(found.search.noise, NOISE, rtol=0.4)
    assert found.localisation.is_located.mean() > 0.9
    assert (((found.localisation.place - p) / found.localisation.place_sd) ** 2).mean() < 1.5


def test_magnetometers_that_answer_do_without_those_that_do_not() -> None:
    """The nearest one at its limit, another one silent for a while."""
    t, mag, p = _recorded(40, 10.0, second=False)
    mag[np.arange(40), np.linalg.norm(p[:, None] - PLACES, axis=2).argmin(axis=1)] = np.nan
    mag[10:20, 3] = np.nan
    found = _searched(t, mag, NOISE).localisation
    assert found.is_located.mean() > 0.9
    assert np.median(np.linalg.norm(found.place - p, axis=1)) < 0.002
    mag[20:, 3:] = np.nan
    found = _searched(t, mag, NOISE).localisation
    assert not found.is_located[20:].any() and np.isnan(found.place[20:]).all()


def test_a_late_magnetometer_is_told_and_its_readings_are_moved() -> None:
    late = np.where(np.arange(12) == 4, 0.06, 0.0)
    t, mag, p = _stamped_late(late)
    found = _searched(t, mag, NOISE)
    np.testing.assert_array_equal(found.timestamp_offsets.offsets != 0, late != 0)
    assert abs(found.timestamp_offsets.offsets[4] - 0.06) < 3 * found.timestamp_offsets.sd[4] < 3e-3
    assert found.localisation.is_located.mean() > 0.9 and found.timestamp_offsets.spread == 0
    square = (((found.localisation.place - p) / found.localisation.place_sd) ** 2)[
        found.localisation.is_located
    ]
    assert (
        square.mean() < 1.5
        and np.median(np.linalg.norm(found.localisation.place - p, axis=1)) < 0.002
    )


def test_magnetometers_read_one_after_the_other_leave_the_time_of_a_place_unsure() -> None:
    """The first one's time is the table's; what readings tell is how much later than the middle one each is."""
    late = np.arange(12) * 4e-3
    t, mag, p = _stamped_late(late)
    found = _searched(t, mag, NOISE)
    ok = found.localisation.is_located
    assert np.abs(found.timestamp_offsets.offsets - (late - np.median(late))).max() < 3e-3
    assert ok.mean() > 0.9 and found.timestamp_offsets.spread > 5e-3
    assert (((found.localisation.place - p) / found.localisation.place_sd)[ok] ** 2).mean() < 2.5


def test_no_lateness_is_made_up_for_readings_of_two_magnets_or_of_one_at_rest() -> None:
    t, mag, _ = _recorded(60, 20.0, second=True)
    assert not _searched(t, mag, NOISE).timestamp_offsets.offsets.any()
    assert not _searched(
        t, mag[:1] + NOISE * np.random.default_rng(1).normal(size=mag.shape), NOISE
    ).timestamp_offsets.offsets.any()
