"""Calibrate a sensor from being laid down in six or more positions and turned from one to the next.

In      samples of one sensor: gyroscope and accelerometer, and a magnetometer if there is one; any
        positions, no equipment
Out     Solved: ImuCalibration, its standard deviations, what is left at rest and over the turns,
        what could not be seen
Source  accelerometer: |M (y - b)| = g at rest, Frosio, Pedersini & Borghese 2009, IEEE Trans.
        Instrum. Meas. 58:2034; gyroscope: Tedaldi, Pretto & Menegatti 2014, ICRA, (14)-(17);
        magnetometer: ellipsoid and constant dip, Kok & Schoen 2016, IEEE Sensors J. 16:5679,
        (20)-(26)
Limits  gravity alone cannot see a turn of the whole sensor: the accelerometer's matrix is taken
        symmetric, the others are relative to it; the local g is a parameter; a magnetometer keeps
        its mean strength, because that of the local field is not known
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.sensors.imu_calibration import ImuCalibration
from handscope.estimators.sensors.static_segments import (
    Rest,
    RestParams,
    distinct_positions,
    find_rests,
    find_turns,
    missing_positions,
)

# entries of a symmetric matrix: scales first
LOWER = (
    (0, 0),
    (1, 1),
    (2, 2),
    (0, 1),
    (0, 2),
    (1, 2),
)
# largest standard deviation of a matrix entry that still counts as observed
SEEN = {
    ACC: 0.01,
    GYR: 0.02,
    MAG: 0.05,
}
DIPS = 4  # positions with a magnetometer that fix its turn against gravity
FIELD_SAMPLES = 2000  # magnetometer samples that the ellipsoid is drawn through


@dataclass(frozen=True, kw_only=True)
class SolveParams(RestParams):
    """Options of the calibration; gravity in m/s^2."""

    gravity: float = option(
        GRAVITY,
        "m/s^2",
        "local gravity",
        "standard gravity, CGPM 1901; between 9.780 and 9.832 on Earth (WGS 84)",
    )


@dataclass(frozen=True)
class SolvedCalibration:
    """A calibration with what is known of it."""

    calibration: ImuCalibration
    matrix_sd: Mapping[str, Array]  # (3, 3) by quantity; infinite where not observed
    bias_sd: Mapping[str, Array]  # (3,)
    # RMS before and after: gyr rad of direction over a turn, acc m/s^2, mag share of the field
    residuals: Mapping[str, tuple[float, float]]
    positions: int
    turns: int
    unobserved: tuple[str, ...] = ()  # in words


@dataclass(frozen=True)
class _Fit:
    x: Array
    sd: Array
    before: float
    after: float


def solve(
    params: SolveParams,
    name: str,
    t: Array,
    gyr: Array,
    acc: Array,
    t_mag: Array | None = None,
    mag: Array | None = None,
) -> SolvedCalibration:
    """Calibrate one sensor from its samples (n, 3); InputError names the position or turn that is
    missing."""
    rests = find_rests(params, t, gyr, acc) if len(t) > 2 else []
    found = distinct_positions(rests)
    _require_positions(name, found)
    unobserved: list[str] = []
    M_a, b_a, sd_a, acc_left = _accelerometer(params, rests, len(found), unobserved)
    up = [v / np.linalg.norm(v) for v in (M_a @ (r.acc - b_a) for r in rests)]
    b_g, bias_sd = _gyroscope_bias(rests)
    ways = find_turns(params, t, gyr, rests)
    M_g, sd_g, gyr_left = _gyroscope(name, t, gyr - b_g, rests, up, ways, unobserved)
    matrix, bias = {GYR: M_g, ACC: M_a}, {GYR: b_g, ACC: b_a}
    matrix_sd, bias_sds = {GYR: sd_g, ACC: sd_a[0]}, {GYR: bias_sd, ACC: sd_a[1]}
    residuals = {GYR: gyr_left, ACC: acc_left}
    if mag is not None and t_mag is not None:
        fitted = _magnetometer(t, t_mag, mag, rests, up)
        if isinstance(fitted, str):
            unobserved.append(fitted)
        else:
            matrix[MAG], bias[MAG], (matrix_sd[MAG], bias_sds[MAG]), residuals[MAG] = fitted
    return SolvedCalibration(
        ImuCalibration(matrix, bias),
        matrix_sd,
        bias_sds,
        residuals,
        len(found),
        len(ways),
        tuple(unobserved),
    )


def _require_positions(name: str, found: list[Array]) -> None:
    missing = missing_positions(found)
    if missing:
        wanted = ", ".join(
            f"{m[1]} axis pointing {'up' if m[0] == '+' else 'down'}" for m in missing
        )
        raise InputError("sensor.no_position_with", name=name, count=len(found), wanted=wanted)
    if len(found) < 6:
        raise InputError("sensor.too_few_positions", name=name, found=len(found))


def _accelerometer(
    params: SolveParams, rests: list[Rest], different: int, unobserved: list[str]
) -> tuple[Array, Array, tuple[Array, Array], tuple[float, float]]:
    """Symmetric matrix and bias that give every rest the length g; scales and biases alone where
    the positions do not show more."""
    mean = np.array([r.acc for r in rests])
    sd = np.array([max(r.acc_noise, 1e-4) / np.sqrt(len(r)) for r in rests])
    entries: tuple[tuple[int, int], ...] = LOWER
    fit = _norm_fit(mean, sd, params.gravity, entries) if different >= 9 else None
    if fit is None or fit.sd[:6].max() > SEEN[ACC]:
        unobserved.append(phrase("sensor.unobserved_acc_cross"))
        entries = LOWER[:3]
        fit = _norm_fit(mean, sd, params.gravity, entries)
    n = len(entries)
    M_sd = _symmetric_matrix(fit.sd[:n], entries, 0.0) + np.where(
        np.eye(3) > 0, 0.0, np.inf if n == 3 else 0.0
    )
    return (
        _symmetric_matrix(fit.x[:n], entries, 0.0),
        fit.x[n:],
        (M_sd, fit.sd[n:]),
        (fit.before, fit.after),
    )


def _norm_fit(y: Array, sd: Array, g: float, entries: tuple[tuple[int, int], ...]) -> _Fit:
    n = len(entries)
    begin = np.concatenate([[1.0 if i == j else 0.0 for i, j in entries], np.zeros(3)])

    def left(x: Array) -> Array:
        return np.asarray(
            (np.linalg.norm((y - x[n:]) @ _symmetric_matrix(x[:n], entries, 0.0), axis=1) - g) / sd
        )

    def slope(x: Array) -> Array:  # d|v|/dx with v = M (y - b), u = v / |v|
        M, d = _symmetric_matrix(x[:n], entries, 0.0), y - x[n:]
        v = d @ M
        u = v / np.linalg.norm(v, axis=1, keepdims=True)
        by_entry = [u[:, i] * d[:, j] + (u[:, j] * d[:, i] if i != j else 0.0) for i, j in entries]
        return np.asarray(np.column_stack([*by_entry, -u @ M]) / sd[:, None])

    return _fit(left, begin, slope, lambda x: float(np.sqrt(np.mean((left(x) * sd) ** 2))))


def _gyroscope_bias(rests: list[Rest]) -> tuple[Array, Array]:
    """Mean over all rests, and its standard deviation from how the rests differ, never less than
    their noise allows."""
    means, weights = np.array([r.gyr for r in rests]), np.array([float(len(r)) for r in rests])
    bias = np.average(means, axis=0, weights=weights)
    noise = np.mean([r.gyr_noise for r in rests]) / np.sqrt(weights.sum())
    spread = np.sqrt(np.average((means - bias) ** 2, axis=0, weights=weights) / (len(rests) - 1))
    return bias, np.maximum(spread, noise)


def _gyroscope(
    name: str,
    t: Array,
    rate: Array,
    rests: list[Rest],
    up: list[Array],
    ways: list[tuple[int, int]],
    unobserved: list[str],
) -> tuple[Array, Array, tuple[float, float]]:
    """Matrix (3, 3) with which the integrated rate takes the direction of gravity from each
    position to the next; scales alone where no more shows."""
    if len(ways) < 5:
        raise InputError("sensor.too_few_turns", name=name, ways=len(ways))
    steps, dt = _steps(t, rate, [(rests[a].last - 1, rests[b].first) for a, b in ways])
    start, end = np.array([up[a] for a, _ in ways]), np.array([up[b] for _, b in ways])
    still = float(np.mean([r.gyr_noise for r in rests]))
    sd = np.array([_direction_sd(still, rests[a], rests[b], d) for (a, b), d in zip(ways, dt)])
    fit, M, M_sd = _turn_fit(steps, start, end, sd, np.ones((3, 3), bool))
    if not M_sd.max() < SEEN[GYR]:
        unobserved.append(phrase("sensor.unobserved_gyr_cross"))
        fit, M, M_sd = _turn_fit(steps, start, end, sd, np.eye(3, dtype=bool))
    unseen = [axis for axis, s in zip("xyz", np.diag(M_sd)) if not s < SEEN[GYR]]
    if unseen:
        raise InputError("sensor.turns_about_axis_missing", name=name, unseen=" and ".join(unseen))
    return M, M_sd, (fit.before, fit.after)


def _turn_fit(
    steps: Array, start: Array, end: Array, sd: Array, free: Bools
) -> tuple[_Fit, Array, Array]:
    """The fit with the matrix's `free` entries, the matrix and its standard deviations, infinite
    where not free."""

    def entries(x: Array, rest: Array) -> Array:
        M = rest.copy()
        M[free] = x
        return M

    def left(x: Array) -> Array:
        q = _product(quat.exp(steps @ entries(x, np.eye(3)).T))
        return np.asarray(((quat.rotate(quat.conjugate(q), start) - end) / sd[:, None]).ravel())

    def miss(x: Array) -> float:
        return float(np.sqrt(((left(x).reshape(-1, 3) * sd[:, None]) ** 2).sum(axis=1).mean()))

    fit = _fit(left, np.eye(3)[free], "2-point", miss)
    return fit, entries(fit.x, np.eye(3)), entries(fit.sd, np.full((3, 3), np.inf))


def _direction_sd(noise: float, a: Rest, b: Rest, dt: Array) -> float:
    """Expected error (rad) of a direction taken over a turn: noise walked through, what is left of
    the bias, noise of both rests."""
    walked = noise * float(np.sqrt((dt**2).sum()))
    bias = noise / np.sqrt(min(len(a), len(b))) * float(dt.sum())
    return (
        float(
            np.sqrt(
                walked**2 + bias**2 + sum((r.acc_noise / GRAVITY) ** 2 / len(r) for r in (a, b))
            )
        )
        + 1e-6
    )


def _steps(t: Array, rate: Array, ways: list[tuple[int, int]]) -> tuple[Array, list[Array]]:
    """Rate times time from sample to sample (ways, longest, 3), zero behind the end; and the
    times."""
    dt = [np.diff(t[a : b + 1]) for a, b in ways]
    steps = np.zeros((len(ways), max(len(d) for d in dt), 3))
    for row, (a, b), d in zip(steps, ways, dt):
        row[: len(d)] = 0.5 * (rate[a:b] + rate[a + 1 : b + 1]) * d[:, None]
    return steps, dt


def _product(q: Array) -> Array:
    """Product along the second axis of (ways, n, 4), by halves."""
    while q.shape[1] > 1:
        if q.shape[1] % 2:
            q = np.concatenate([q, np.broadcast_to(quat.IDENTITY, (len(q), 1, 4))], axis=1)
        q = quat.multiply(q[:, 0::2], q[:, 1::2])
    return q[:, 0]


def _magnetometer(t: Array, t_mag: Array, mag: Array, rests: list[Rest], up: list[Array]) -> Any:
    """Matrix, bias, their standard deviations and residuals of the field's constant strength and
    dip; a sentence where they cannot be seen."""
    whole = np.isfinite(mag).all(axis=1)
    t_mag, mag = t_mag[whole], mag[whole]
    if len(mag) < 100 or (np.ptp(mag, axis=0) == 0).any():
        return phrase("sensor.unobserved_mag_constant")
    pieces = [mag[slice(*np.searchsorted(t_mag, [t[r.first], t[r.last - 1]]))] for r in rests]
    used = [k for k, p in enumerate(pieces) if len(p) > 3]
    if len(used) < DIPS:
        return phrase("sensor.unobserved_mag_positions", count=len(used), needed=DIPS)
    centre, size = 0.5 * (mag.max(axis=0) + mag.min(axis=0)), 0.5 * float(np.ptp(mag, axis=0).max())
    y = (mag[:: max(1, len(mag) // FIELD_SAMPLES)] - centre) / size
    mean, count = (
        (np.array([pieces[k].mean(axis=0) for k in used]) - centre) / size,
        np.array([len(pieces[k]) for k in used]),
    )
    noise = max(
        float(np.sqrt(np.mean([pieces[k].var(axis=0, ddof=1).mean() for k in used]))) / size, 1e-6
    )
    fit = _dip_fit(y, mean, np.array([up[k] for k in used]), noise, noise / np.sqrt(count))
    if not fit.sd[:9].max() < SEEN[MAG]:
        return phrase("sensor.unobserved_mag_directions")
    # strength of the field: the readings' own mean
    M, scale = (
        fit.x[:9].reshape(3, 3),
        np.cbrt(np.linalg.det(fit.x[:9].reshape(3, 3))),
    )
    sd = fit.sd[:9].reshape(3, 3) / scale, fit.sd[9:12] * size
    return M / scale, centre + size * fit.x[9:12], sd, (fit.before, fit.after)


def _dip_fit(y: Array, mean: Array, up: Array, sd: float, mean_sd: Array) -> _Fit:
    """Matrix (9), bias (3) and the sine of the dip: |M (y - b)| = 1, up . M (y - b) = sine at rest;
    Kok & Schoen 2016, (20), (25)."""

    def strength(x: Array) -> Array:
        return np.asarray(np.linalg.norm((y - x[9:12]) @ x[:9].reshape(3, 3).T, axis=1) - 1.0)

    def left(x: Array) -> Array:
        dip = (up * ((mean - x[9:12]) @ x[:9].reshape(3, 3).T)).sum(axis=1) - x[12]
        return np.concatenate([strength(x) / sd, dip / mean_sd])

    begin = np.concatenate(
        [np.eye(3).ravel(), np.zeros(3), [float((up * mean).sum(axis=1).mean())]]
    )
    return _fit(left, begin, "2-point", lambda x: float(np.sqrt(np.mean(strength(x) ** 2))))


def _fit(
    left: Callable[[Array], Array], begin: Array, slope: Any, rms: Callable[[Array], float]
) -> _Fit:
    """Least squares of whitened residuals; standard deviations from their curvature, larger where
    the residuals are larger than expected."""
    found = least_squares(left, begin, jac=slope, method="trf", x_scale="jac")
    s, V = np.linalg.svd(np.asarray(found.jac), full_matrices=False)[1:]
    seen = s > 1e-9 * s[0]
    variance = (V[seen].T ** 2 / s[seen] ** 2).sum(axis=1)
    variance[(V[~seen] ** 2).sum(axis=0) > 1e-6] = np.inf
    freedom = len(found.fun) - len(begin)
    excess = max(1.0, 2 * found.cost / freedom) if freedom > 0 else 1.0
    sd = np.sqrt(variance * excess) if len(found.fun) >= len(begin) else np.full(len(begin), np.inf)
    return _Fit(found.x, sd, rms(begin), rms(found.x))


def _symmetric_matrix(values: Array, entries: tuple[tuple[int, int], ...], rest: float) -> Array:
    M = np.full((3, 3), rest)
    for (i, j), value in zip(entries, values):
        M[i, j] = M[j, i] = value
    return M
