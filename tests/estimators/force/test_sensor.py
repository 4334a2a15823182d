"""What a force sensor's raw readings mean: known loads tell matrix and offset, as sure as they say; loads that cannot are refused."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import SolveParams, is_repeated, is_stuck, solve
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
WAYS = np.vstack([np.eye(3), -np.eye(3)])


def loads_of(axes: int, rng: np.random.Generator) -> Array:
    """Half a kilogram and 200 g in six positions, of a sensor with six axes at two places each, and nothing."""
    forces = 9.81 * np.vstack([0.5 * WAYS, 0.2 * WAYS])
    if axes == 3:
        return np.vstack([forces, np.zeros(3)])
    both = np.repeat(forces, 2, axis=0)
    return np.vstack(
        [np.hstack([both, np.cross(rng.uniform(-0.02, 0.02, both.shape), both)]), np.zeros(6)]
    )


def read(axes: int, channels: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """Loads, what they read, true gains (channels, axes) and offset."""
    rng = np.random.default_rng(seed)
    loads = loads_of(axes, rng)
    gains, offset = (
        0.1 * np.eye(channels, axes) + 0.02 * rng.normal(size=(channels, axes)),
        rng.normal(size=channels),
    )
    return (
        loads,
        loads @ gains.T + offset + 1e-3 * rng.normal(size=(len(loads), channels)),
        gains,
        offset,
    )


@pytest.mark.parametrize(("axes", "channels"), [(3, 3), (3, 4), (6, 6), (6, 12)])
def test_known_loads_tell_matrix_and_offset_as_surely_as_is_said(axes: int, channels: int) -> None:
    surprise, of_offset, beyond = [], [], 0
    for seed in range(40):
        loads, raw, gains, offset = read(axes, channels, seed)
        found = solve(SolveParams(), raw, loads)
        assert found.left_out == ()
        if axes == channels:
            surprise.append(
                (((found.calibration.matrix - np.linalg.inv(gains)) / found.matrix_sd) ** 2).mean()
            )
        of_offset.append((((found.calibration.offset - offset) / found.offset_sd) ** 2).mean())
        force = np.random.default_rng(seed + 100).normal(size=(20, axes)) * np.sqrt(
            (loads**2).mean(axis=0)
        )
        off = found.calibration.corrected(force @ gains.T + found.calibration.offset) - force
        beyond += np.linalg.norm(off[:, :3]) > 2.0 * found.calibration.scale_sd * np.linalg.norm(
            force[:, :3]
        )
    assert axes != channels or 0.5 < np.mean(surprise) < 1.6
    assert 0.5 < np.mean(of_offset) < 1.6
    assert beyond <= 4, "within two standard deviations in nine of ten"


def test_weights_and_an_accelerometer_tell_forces_as_surely_as_is_said() -> None:
    """Weights of a kitchen along all axes, both ways; an accelerometer with a bias that it has in every position tells the directions."""
    of_scale, of_turn = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        along = np.vstack([WAYS, WAYS]) + 0.05 * rng.normal(size=(2 * len(WAYS), 3))
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        weights = 9.81 * np.repeat([0.1, 0.2], len(WAYS))[:, None]
        read = np.vstack([weights * along, np.zeros(3)]) * (1 + 0.005 * rng.normal())
        seen = 9.81 * along + 0.05 * rng.normal(size=3) + 0.01 * rng.normal(size=along.shape)
        loads = np.vstack(
            [weights * seen / np.linalg.norm(seen, axis=1, keepdims=True), np.zeros(3)]
        )
        found = solve(SolveParams(), read + 0.01 * rng.normal(size=read.shape), loads)
        off = found.calibration.matrix - np.eye(3)
        along_itself = np.einsum("ni,ij,nj->n", WAYS, off, WAYS) / (WAYS**2).sum(axis=1)
        turned = 0.5 * (off - off.T)[[2, 0, 1], [1, 2, 0]]
        of_scale.append((along_itself**2).mean() / found.calibration.scale_sd**2)
        of_turn.append((turned**2).mean() / found.turn_sd**2)
    assert 0.25 < np.mean(of_scale) < 1.2
    assert 0.1 < np.mean(of_turn) < 1.2


def test_what_loads_from_one_side_leave_open_is_told() -> None:
    """An accelerometer's bias turns loads that hang one way alone, and cancels where they hang both ways."""
    rng, told = np.random.default_rng(0), []
    for ways in (np.vstack([np.eye(3), -np.eye(3)]), np.vstack([np.eye(3), 2 * np.eye(3)])):
        loads = np.vstack([2 * ways, ways, np.zeros(3)])
        told.append(
            solve(SolveParams(), loads + 1e-3 * rng.normal(size=loads.shape), loads).turn_sd
        )
    assert told[0] < 0.1 * DEG
    assert told[1] == pytest.approx(0.3 * DEG, rel=0.35)


def test_a_load_that_was_written_down_wrongly_is_named_and_left_out() -> None:
    loads, raw, gains, _ = read(3, 3, 1)
    loads[4] = loads[7]
    found = solve(SolveParams(), raw, loads)
    assert found.left_out == (4,)
    np.testing.assert_allclose(
        found.calibration.matrix, np.linalg.inv(gains), atol=5 * found.matrix_sd.max()
    )
    raw[5, 1] = np.nan
    assert solve(SolveParams(), raw, loads).used == len(loads) - 2


def thirteen(axes: int, seed: int) -> tuple[np.random.Generator, Array, Array]:
    """Loads and readings: one weight in each of six positions twice, and nothing."""
    rng = np.random.default_rng([seed, axes])
    forces = 9.81 * np.vstack([0.5 * WAYS, 0.2 * WAYS])
    loads = np.vstack(
        [
            np.hstack([forces, np.cross(rng.uniform(-0.02, 0.02, forces.shape), forces)])[:, :axes],
            np.zeros(axes),
        ]
    )
    gains = 0.1 * np.eye(axes) + 0.02 * rng.normal(size=(axes, axes))
    return rng, loads, loads @ gains.T + rng.normal(size=axes) + 1e-3 * rng.normal(size=loads.shape)


def left_out(raw: Array, loads: Array) -> tuple[int, ...] | None:
    """None: refused."""
    try:
        return solve(SolveParams(), raw, loads).left_out
    except InputError:
        return None


@pytest.mark.parametrize("axes", [3, 6])
def test_of_thirteen_rows_the_wrong_one_is_named_and_of_two_wrong_ones_no_other(axes: int) -> None:
    named = 0
    for seed in range(60):
        rng, loads, raw = thirteen(axes, seed)
        wrong, other, third = rng.choice(13, 3, replace=False)
        loads[wrong] = loads[other]
        found = left_out(raw, loads)
        assert found in ((wrong,), None)
        named += found is not None
        loads[third] = loads[other]
        assert left_out(raw, loads) in (None, tuple(sorted((wrong, third))))
    assert named >= 58


def test_a_sensor_that_saturates_is_as_unsure_as_it_bends_and_readings_of_other_loads_are_refused() -> (
    None
):
    loads, raw, _, _ = read(3, 3, 2)
    straight, bent = (
        solve(SolveParams(chance=0.0), y, loads).calibration.scale_sd
        for y in (raw, np.tanh(raw - raw[-1]))
    )
    assert bent > 3 * straight
    with pytest.raises(InputError, match="do not follow the loads"):
        solve(SolveParams(chance=0.0), np.random.default_rng(0).permutation(raw), loads)


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        (slice(0, 6), "6 known loads are too few; give at least 7"),
        ([0, 1, 3, 4, 6, 7, 9, 10, 12], "do not tell force z"),
        ([0, 1, 2, 0, 1, 2, 0, 1, 2], "do not tell force x, force y, force z, no load"),
    ],
    ids=["too few", "none along z", "never without a load"],
)
def test_loads_that_do_not_tell_the_matrix_are_refused(kept: list[int] | slice, said: str) -> None:
    loads, raw, _, _ = read(3, 3, 3)
    with pytest.raises(InputError, match=said):
        solve(SolveParams(), raw[kept], loads[kept])


def test_channels_that_do_not_answer_are_refused() -> None:
    loads, raw, _, _ = read(3, 3, 4)
    raw[:, 2] = 0.7
    with pytest.raises(InputError, match="hardly change with the loads"):
        solve(SolveParams(), raw, loads)
    with pytest.raises(InputError, match="2 channels cannot tell 3 axes"):
        solve(SolveParams(), raw[:, :2], loads)


def test_a_channel_at_its_end_makes_the_whole_reading_untold() -> None:
    loads, raw, _, _ = read(3, 3, 5)
    calibration = solve(SolveParams(), raw, loads).calibration
    rng = np.random.default_rng(0)
    readings = (
        raw[-1]
        + 0.1 * np.sin(np.arange(60) / 10)[:, None] ** 4 * np.array([5.0, 1.0, 0.5])
        + 1e-3 * rng.normal(size=(60, 3))
    )
    clipped = np.minimum(readings, raw[-1] + [0.4, 9.0, 9.0])
    np.testing.assert_array_equal(
        calibration.clipped(clipped), clipped[:, 0] == clipped[:, 0].max()
    )
    assert not calibration.clipped(readings).any()


def held(noise: float, count: float, seed: int) -> Array:
    """15 s of a pinch at 12 Hz (180, 3) N, by a sensor with such noise and counts; held and varied between the 48th and the 132nd reading."""
    rng, t = np.random.default_rng(seed), np.arange(180) / 12
    size = np.clip(np.minimum(t - 4.0, 11.0 - t) / 0.4, 0.0, 1.0) * (3 + np.sin(3 * t))
    return (
        np.round((size[:, None] * [0.3, -0.2, 1.0] + noise * rng.normal(size=(180, 3))) / count)
        * count
    )


def test_a_sensor_that_tells_an_old_sample_again_and_again_is_found() -> None:
    fine = held(0.05, 0.004, 0)
    fine[100:112] = fine[99]
    np.testing.assert_array_equal(np.flatnonzero(is_repeated(fine)), np.arange(100, 112))
    fine[30:33] = np.inf  # a raw channel at its limit
    np.testing.assert_array_equal(np.flatnonzero(is_repeated(fine)), np.arange(100, 112))
    assert not is_repeated(held(0.05, 0.004, 1)).any()


def test_coarse_counts_are_neither_old_samples_nor_a_limit() -> None:
    for noise in (0.0, 0.01, 0.05):
        told = sum(
            is_repeated(held(noise, 0.1, seed)).sum() + is_stuck(held(noise, 0.1, seed)).sum()
            for seed in range(10)
        )
        assert told == 0, noise


def test_a_limit_of_coarse_counts_is_found_still() -> None:
    clipped = np.clip(held(0.05, 0.05, 2), -5.0, 3.0)
    clipped[70:85, 2] = 3.0
    assert is_stuck(clipped)[70:85].all()
