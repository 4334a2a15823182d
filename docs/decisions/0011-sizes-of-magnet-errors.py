"""Sizes of errors for the magnet's filter that real recordings tell: accelerometer and gyroscope over short times, and how a room's field differs.

Run     python docs/decisions/0011-sizes-of-magnet-errors.py BROAD, from the repository; a minute. BROAD: folder of data_mat,
        https://github.com/dlaidig/broad (CC BY 4.0; Laidig et al. 2021, doi:10.3390/data6070072), its undisturbed trials
Out     for ranges of acceleration: what the velocity errs by over 0.5 to 2 s, over the root of the time; of rate: the turn; of distance: the field
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, sosfiltfilt

from estimators import quaternions as quat
from estimators.quaternions import Array

GRAVITY = 9.8127  # m/s^2 in Berlin
EDGE = 5.0  # s at both ends that are left out
SECONDS = (0.5, 1.0, 2.0)
PUSHES = (0.3, 0.7, 1.5, 3, 6, 12, 40)  # m/s^2
RATES = (0.3, 0.7, 1.5, 3, 5, 8, 20)  # rad/s
DISTANCES = (0, 0.1, 0.2, 0.3, 0.5, 0.8)  # m
UPRIGHT = np.radians(10.0)  # readings that are compared are turned by less: what the calibration of a magnetometer leaves drops out


@dataclass(frozen=True)
class Trial:
    rate: float  # Hz
    q: Array  # (n, 4) of the board, by cameras; where they lost it the last one
    p: Array  # (n, 3) m
    gyr: Array  # (n, 3) rad/s
    acc: Array  # (n, 3) m/s^2
    mag: Array  # (n, 3) uT
    good: NDArray[np.bool_]  # (n,) seen while it is moved


def read(path: Path) -> Trial:
    d = loadmat(path, squeeze_me=True)
    q, p = d["opt_quat"], d["opt_pos"]
    seen = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    last = np.maximum.accumulate(np.where(seen, np.arange(len(q)), int(seen.argmax())))
    return Trial(
        float(d["sampling_rate"]), q[last], p[last], np.nan_to_num(d["imu_gyr"]), np.nan_to_num(d["imu_acc"]), d["imu_mag"],
        seen & d["movement"].astype(bool),
    )  # fmt: skip


def windows(trial: Trial, seconds: float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """First and last samples of windows that overlap by half, in which the board is moved and seen at both ends."""
    long, edge = int(seconds * trial.rate), int(EDGE * trial.rate)
    first = np.arange(edge, len(trial.q) - long - edge, long // 2)
    kept = trial.good[first] & trial.good[first + long]
    return first[kept], first[kept] + long


def summed(values: Array, dt: float) -> Array:
    """Integral up to each sample, by trapezoids."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(0.5 * dt * (values[1:] + values[:-1]), axis=0)])


def skew(v: Array) -> Array:
    """Matrices (n, 3, 3) of v x."""
    return np.cross(v[:, None, :], np.eye(3)[None], axis=-1).transpose(0, 2, 1)


def left(slopes: Array, errors: Array) -> Array:
    """Errors (m, 3) without what is the same all the time, along the slopes (m, 3, k)."""
    same = np.linalg.lstsq(slopes.reshape(-1, slopes.shape[2]), errors.ravel(), rcond=None)[0]
    return np.asarray(errors - slopes @ same)


def loudness(values: Array, first: NDArray[np.int_], last: NDArray[np.int_]) -> Array:
    """Root mean square of the lengths of values (n, 3) in each window."""
    total = np.concatenate([[0.0], np.cumsum((values**2).sum(axis=1))])
    return np.sqrt((total[last] - total[first]) / (last - first))


def velocities(trial: Trial, seconds: float) -> tuple[Array, Array]:
    """Acceleration in each window, and the squared error of its change of velocity, an axis and a second; bias, turn on the board, lever arm, g taken off."""
    first, last = windows(trial, seconds)
    dt, R = 1.0 / trial.rate, quat.matrix(trial.q)
    smooth = sosfiltfilt(butter(2, 20.0 / trial.rate, output="sos"), trial.p, axis=0)  # 10 Hz
    v = np.gradient(smooth, dt, axis=0)
    parts = (R, -R @ skew(trial.acc), np.broadcast_to(np.eye(3), R.shape))
    slopes = [(whole := summed(part, dt))[last] - whole[first] for part in parts]
    arm = R @ skew(trial.gyr)
    force = summed(np.einsum("nij,nj->ni", R, trial.acc), dt)
    off = force[last] - force[first] - (v[last] - v[first]) - np.array([0.0, 0.0, GRAVITY]) * ((last - first) * dt)[:, None]
    squared = (left(np.concatenate([*slopes, arm[last] - arm[first]], axis=2), off) ** 2).mean(axis=1)
    return loudness(trial.acc - R.transpose(0, 2, 1) @ np.array([0.0, 0.0, GRAVITY]), first, last), squared / seconds


def turns(trial: Trial, seconds: float) -> tuple[Array, Array]:
    """Rate in each window, and the squared error of its turn, an axis and a second; bias and turn on the board taken off."""
    first, last = windows(trial, seconds)
    dt = 1.0 / trial.rate
    ours = np.tile(quat.IDENTITY, (len(first), 1))
    carried = np.zeros((len(first), 3, 3))
    for k in range(int(last[0] - first[0])):
        step = quat.exp(0.5 * dt * (trial.gyr[first + k] + trial.gyr[first + k + 1]))
        ours = quat.multiply(ours, step)
        carried = quat.matrix(quat.conjugate(step)) @ carried + dt * np.eye(3)
    true = quat.relative(trial.q[first], trial.q[last])
    same = np.concatenate([carried, np.eye(3) - quat.matrix(quat.conjugate(true))], axis=2)
    squared = (left(same, quat.log(quat.relative(ours, true))) ** 2).mean(axis=1)
    return loudness(trial.gyr, first, last), squared / seconds


def fields(trial: Trial) -> tuple[Array, Array]:
    """Distances (pairs,) of places and differences (pairs, 3) of the field there, uT: across itself, along, down; each the mean of a tenth of a second."""
    long = int(trial.rate / 10)
    first = np.arange(0, len(trial.q) - long, long)
    first = first[[bool(trial.good[k : k + long].all()) for k in first]]
    B = quat.rotate(trial.q, trial.mag)
    means, places = (np.array([v[k : k + long].mean(axis=0) for k in first]) for v in (B, trial.p))
    a, b = np.random.default_rng(0).integers(0, len(first), (2, 200_000))
    alike = quat.angle(quat.relative(trial.q[first[a]], trial.q[first[b]])) < UPRIGHT
    difference, away = (means[a] - means[b])[alike], np.linalg.norm((places[a] - places[b])[alike], axis=1)
    level = means[:, :2].mean(axis=0) / np.linalg.norm(means[:, :2].mean(axis=0))
    return away, np.column_stack([difference[:, :2] @ [-level[1], level[0]], difference[:, :2] @ level, difference[:, 2]])


def main(folder: str) -> None:
    trials = {p.stem: read(p) for p in sorted(Path(folder).glob("*_undisturbed_*.mat"))}
    for name, kind, limits in (("acceleration, m/s^2", velocities, PUSHES), ("rate, rad/s", turns, RATES)):
        for seconds in SECONDS:
            size, squared = (np.concatenate(x) for x in zip(*(kind(trial, seconds) for trial in trials.values())))
            for low, high in zip(limits, limits[1:]):
                among = (size >= low) & (size < high)
                if among.sum() > 10:
                    print(f"{name} {low:4g}-{high:<4g} over {seconds:g} s: {np.sqrt(squared[among].mean()):.4f} a root second")  # noqa: T201
    for title, trial in trials.items():
        if "slow_translation" in title:
            away, difference = fields(trial)
            for low, high in zip(DISTANCES, DISTANCES[1:]):
                among = (away >= low) & (away < high)
                sizes = np.sqrt((difference[among] ** 2).mean(axis=0))
                print(f"{title[:2]}: {low:g}-{high:g} m apart: field {sizes.round(2)} uT across itself, along, down")  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
