"""Sizes of errors for the magnet's filter that real recordings tell: accelerometer and gyroscope over short times, and how a room's field differs.

Run     python docs/decisions/0011-sizes-of-magnet-errors.py BROAD, from the repository; half a minute. BROAD: folder of data_mat,
        https://github.com/dlaidig/broad (CC BY 4.0; Laidig et al. 2021, doi:10.3390/data6070072), its undisturbed trials
Out     for each trial the accelerometer's error as white noise and how late it is against the cameras; for ranges of rate what the turn errs by over 0.25 to 8 s,
        and how that grows; for ranges of distance how the field differs
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.linalg import block_diag
from scipy.optimize import minimize

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

GRAVITY = 9.8127  # m/s^2 in Berlin
EDGE = 5.0  # s at both ends that are left out
WINDOWS = (1.0, 2.0)  # s over which places are compared
LOOKED = 20.0  # Hz at which they are
SPANS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # s over which turns are compared
RATES = (0.3, 0.7, 1.5, 3, 5, 8)  # rad/s
FEW = 10  # windows that say nothing
DISTANCES = (0, 0.1, 0.2, 0.3, 0.5, 0.8)  # m
UPRIGHT = np.radians(
    10.0
)  # readings that are compared are turned by less: what the calibration of a magnetometer leaves drops out


@dataclass(frozen=True)
class Trial:
    rate: float  # Hz
    q: Array  # (n, 4) of the board, by cameras; where they lost it the last one
    p: Array  # (n, 3) m
    gyr: Array  # (n, 3) rad/s
    acc: Array  # (n, 3) m/s^2
    mag: Array  # (n, 3) uT
    good: Bools  # (n,) seen while it is moved


def read(path: Path) -> Trial:
    d = loadmat(path, squeeze_me=True)
    q, p = d["opt_quat"], d["opt_pos"]
    seen = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    last = np.maximum.accumulate(np.where(seen, np.arange(len(q)), int(seen.argmax())))
    return Trial(
        float(d["sampling_rate"]), q[last], p[last], np.nan_to_num(d["imu_gyr"]), np.nan_to_num(d["imu_acc"]), d["imu_mag"],
        seen & d["movement"].astype(bool),
    )  # fmt: skip


def starts(trial: Trial, seconds: float, step: float) -> NDArray[np.int_]:
    """First samples of windows, each `step` of its length after the one before, in which the board is moved and seen all the time."""
    long, edge = round(seconds * trial.rate), round(EDGE * trial.rate)
    first = np.arange(edge, len(trial.q) - long - edge, round(step * long))
    return first[[bool(trial.good[k : k + long + 1].all()) for k in first]]


def summed(values: Array, dt: float) -> Array:
    """Integral up to each sample, by trapezoids."""
    return np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(0.5 * dt * (values[1:] + values[:-1]), axis=0)]
    )


def skew(v: Array) -> Array:
    """Matrices (n, 3, 3) of v x."""
    return np.cross(v[:, None, :], np.eye(3)[None], axis=-1).transpose(0, 2, 1)


def loudness(values: Array, first: NDArray[np.int_], long: int) -> Array:
    """Root mean square of the lengths of values (n, 3) in each window."""
    total = np.concatenate([[0.0], np.cumsum((values**2).sum(axis=1))])
    return np.sqrt((total[first + long] - total[first]) / long)


@dataclass(frozen=True)
class Carried:
    """A window: the cameras' places less those that the sensor tells (m,), and the slopes of what is not its noise."""

    off: Array  # (3 k,)
    own: Array  # (3 k, 9) by place, velocity and inclination at its start
    shared: (
        Array  # (3 k, 10) by what is alike in a trial: biases of both sensors, lever arm, lateness
    )
    push: float  # m/s^2, root mean square


def followed(trial: Trial, first: int, long: int) -> Carried:
    """The sensor carried on from the cameras' orientation at the window's first sample by its own readings alone: the cameras' turns do not come in."""
    part, dt = slice(first, first + long + 1), 1.0 / trial.rate
    q = np.empty((long + 1, 4))
    q[0] = trial.q[first]
    steps = quat.exp(0.5 * dt * (trial.gyr[part][1:] + trial.gyr[part][:-1]))
    for k in range(long):
        q[k + 1] = quat.multiply(q[k], steps[k])
    R, pull = quat.matrix(q), np.array([0.0, 0.0, GRAVITY])
    force = quat.rotate(q, trial.acc[part])
    S, t, one = (
        skew(force),
        np.arange(long + 1)[:, None, None] * dt,
        np.broadcast_to(np.eye(3), R.shape),
    )

    def twice(values: Array) -> Array:
        return summed(summed(values, dt), dt)

    own = np.concatenate([one, t * one, -twice(S)], axis=2)
    velocity = np.gradient(trial.p[part], dt, axis=0)[..., None]
    shared = np.concatenate(
        [-twice(R), -twice(S @ summed(R, dt)), quat.matrix(trial.q[part]), velocity], axis=2
    )
    looked = np.arange(0, long + 1, round(trial.rate / LOOKED))
    push = float(np.sqrt(((force - pull) ** 2).sum(axis=1).mean()))
    off = trial.p[part] - twice(force - pull)
    return Carried(
        off[looked].ravel(), own[looked].reshape(-1, 9), shared[looked].reshape(-1, 10), push
    )


def accelerometer(trial: Trial, seconds: float) -> tuple[float, float, float, float]:
    """Likeliest white noise of the accelerometer, m/s^2/sqrt(Hz), and of the cameras' places, m; mean push, m/s^2; lateness of the sensor, s."""
    long = round(seconds * trial.rate)
    paths = [followed(trial, int(k), long) for k in starts(trial, seconds, 1.0)]
    free = [np.linalg.qr(p.own, mode="complete")[0][:, 9:] for p in paths]
    slopes, off = (
        np.concatenate(x)
        for x in zip(*((Z.T @ p.shared, Z.T @ p.off) for Z, p in zip(free, paths)))
    )
    same = np.linalg.lstsq(slopes, off, rcond=None)[0]
    t = np.arange(0, long + 1, round(trial.rate / LOOKED)) / trial.rate
    early, late = np.minimum.outer(t, t), np.maximum.outer(t, t)
    walked = np.kron(
        early**2 / 2 * (late - early / 3), np.eye(3)
    )  # covariance of white noise integrated twice
    shapes = [np.linalg.eigh(Z.T @ walked @ Z) for Z in free]
    left = block_diag(*(U for _, U in shapes)).T @ (off - slopes @ same)
    growing = np.concatenate([size for size, _ in shapes])

    def unlikely(logs: Array) -> float:
        variance = np.exp(2 * logs[0]) * growing + np.exp(2 * logs[1])
        return float((np.log(variance) + left**2 / variance).sum())

    noise, cameras = np.exp(minimize(unlikely, np.log([0.01, 1e-3]), method="Nelder-Mead").x)
    return float(noise), float(cameras), float(np.mean([p.push for p in paths])), float(same[-1])


def turns(trial: Trial, seconds: float) -> tuple[Array, Array]:
    """Rate in each window, and the squared error of its turn, rad^2 an axis; bias, turn on the board and lateness taken off."""
    first, long = starts(trial, seconds, 0.5), round(seconds * trial.rate)
    dt = 1.0 / trial.rate
    ours = np.tile(quat.IDENTITY, (len(first), 1))
    carried = np.zeros((len(first), 3, 3))
    for k in range(long):
        step = quat.exp(0.5 * dt * (trial.gyr[first + k] + trial.gyr[first + k + 1]))
        ours = quat.multiply(ours, step)
        carried = quat.matrix(quat.conjugate(step)) @ carried + dt * np.eye(3)
    true = quat.relative(trial.q[first], trial.q[first + long])
    late = trial.gyr[first + long] - quat.rotate(quat.conjugate(true), trial.gyr[first])
    slopes = np.concatenate(
        [carried, np.eye(3) - quat.matrix(quat.conjugate(true)), late[..., None]], axis=2
    )
    off = quat.log(quat.relative(ours, true))
    same = np.linalg.lstsq(slopes.reshape(-1, slopes.shape[2]), off.ravel(), rcond=None)[0]
    return loudness(trial.gyr, first, long), ((off - slopes @ same) ** 2).mean(axis=1)


def grown(squared: Array) -> tuple[float, float]:
    """What of squared errors over SPANS stays, and what grows by the second; each counts by its size. NaN: too few windows."""
    known = np.isfinite(squared)
    slopes = np.column_stack([np.ones(len(SPANS)), SPANS])[known] / squared[known, None]
    stays, grows = np.linalg.lstsq(slopes, np.ones(known.sum()), rcond=None)[0]
    return float(stays), float(grows)


def fields(trial: Trial) -> tuple[Array, Array]:
    """Distances (pairs,) of places and differences (pairs, 3) of the field there, uT: across itself, along, down; each the mean of a tenth of a second."""
    long = int(trial.rate / 10)
    first = np.arange(0, len(trial.q) - long, long)
    first = first[[bool(trial.good[k : k + long].all()) for k in first]]
    B = quat.rotate(trial.q, trial.mag)
    means, places = (np.array([v[k : k + long].mean(axis=0) for k in first]) for v in (B, trial.p))
    a, b = np.random.default_rng(0).integers(0, len(first), (2, 200_000))
    alike = quat.angle(quat.relative(trial.q[first[a]], trial.q[first[b]])) < UPRIGHT
    difference, away = (
        (means[a] - means[b])[alike],
        np.linalg.norm((places[a] - places[b])[alike], axis=1),
    )
    level = means[:, :2].mean(axis=0) / np.linalg.norm(means[:, :2].mean(axis=0))
    return away, np.column_stack(
        [difference[:, :2] @ [-level[1], level[0]], difference[:, :2] @ level, difference[:, 2]]
    )


def main(folder: str) -> None:
    trials = {p.stem: read(p) for p in sorted(Path(folder).glob("*_undisturbed_*.mat"))}
    for title, trial in trials.items():
        for seconds in WINDOWS:
            noise, cameras, push, late = accelerometer(trial, seconds)
            print(  # noqa: T201
                f"{title[:2]}, {seconds:g} s, {push:.1f} m/s^2: accelerometer {noise:.4f} m/s^2/sqrt(Hz), cameras {1e3 * cameras:.2f} mm, sensor {1e3 * late:.1f} ms late"
            )
    found = [[turns(trial, span) for trial in trials.values()] for span in SPANS]
    for low, high in zip(RATES, RATES[1:]):
        table = np.full((len(SPANS), len(trials)), np.nan)
        for i, row in enumerate(found):
            for j, (rate, squared) in enumerate(row):
                among = (rate >= low) & (rate < high)
                table[i, j] = squared[among].mean() if among.sum() > FEW else np.nan
        for j, title in enumerate(trials):
            if np.isfinite(table[:, j]).sum() > 3:
                stays, grows = grown(table[:, j])
                share = np.sign(grows) * np.sqrt(abs(grows) / (low * high))
                said = f"{1e3 * np.sqrt(stays):.1f} mrad, and {100 * share:.2f} % of the rate a root second"
                print(f"{title[:2]}, {low:g}-{high:g} rad/s: {said}")  # noqa: T201
    for title, trial in trials.items():
        if "slow_translation" in title:
            away, difference = fields(trial)
            for low, high in zip(DISTANCES, DISTANCES[1:]):
                among = (away >= low) & (away < high)
                sizes = np.sqrt((difference[among] ** 2).mean(axis=0))
                print(  # noqa: T201
                    f"{title[:2]}: {low:g}-{high:g} m apart: field {sizes.round(2)} uT across itself, along, down"
                )


if __name__ == "__main__":
    main(*sys.argv[1:])
