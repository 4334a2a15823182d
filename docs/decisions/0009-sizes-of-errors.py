"""Sizes of errors that real recordings tell: of the vertical as a fusion sees it, and of a gyroscope's bias after a pose of three seconds.

Run     python docs/decisions/0009-sizes-of-errors.py BROAD QMT, from the repository; half a minute.
        BROAD: folder of data_mat, https://github.com/dlaidig/broad (CC BY 4.0; Laidig et al. 2021, doi:10.3390/data6070072), the ten trials of `handscope
        reproduce broad`; QMT: examples/full_body_example_data.mat of https://github.com/dlaidig/qmt (MIT), 16 sensors on a person who first stands still
Out     for ranges of the rate over 3 s: error of the vertical a level axis, and the line fitted to its square; what the bias errs by beside its scatter
"""

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.validation.papers import published
from handscope.validation.studies import broad

UP = np.array([0.0, 0.0, 1.0])
LASTS = 3.0  # s that errors of VQF's vertical stay alike: its tauAcc
PIECES = 60  # of a trial
POSE = 3.0  # s
RANGES = (0, 30, 100, 150, 200, 300, 600)  # deg/s


def skew(v: Array) -> Array:
    """Matrices (n, 3, 3) of v x."""
    return np.cross(v[:, None, :], np.eye(3)[None], axis=-1).transpose(0, 2, 1)


def changing(trial: broad.Trial) -> tuple[Array, Array]:
    """Rates over the 3 s before (deg/s, root mean square) and squared errors (deg^2, a level axis), of pieces of the trial.

    What is the same all the time is taken off: an accelerometer's bias, the turn of the sensor on its board, the cameras' vertical.
    """
    q_GS = broad.oriented(trial, *broad.FUSIONS["6D"])
    seen = np.isfinite(trial.q_ref).all(axis=1)
    fit = (seen & trial.movement)[seen]
    q_GS, q_ref = q_GS[seen], trial.q_ref[seen]
    true, ours = (quat.rotate(quat.conjugate(q), UP) for q in (q_ref, q_GS))
    error, across = np.cross(true, ours), skew(true)
    stays = np.concatenate(
        [
            across,
            -across @ across,
            (-across @ across @ quat.matrix(q_ref).transpose(0, 2, 1))[:, :, :2],
        ],
        axis=2,
    )
    same = np.linalg.lstsq(stays[fit].reshape(-1, 8), error[fit].ravel(), rcond=None)[0]
    left = np.degrees(np.sqrt(((error - stays @ same) ** 2).sum(axis=1) / 2))
    squared, lively = (trial.gyr**2).sum(axis=1), np.empty(len(trial.gyr))
    newest = 0.0
    for k, value in enumerate(squared):
        newest += (value - newest) / (LASTS * trial.rate)
        lively[k] = newest
    pieces = np.array_split(np.flatnonzero(seen)[int(5 * trial.rate) :], PIECES)
    left_at = np.full(len(trial.gyr), np.nan)
    left_at[seen] = left
    return np.array([np.degrees(np.sqrt(lively[p].mean())) for p in pieces]), np.array(
        [(left_at[p] ** 2).mean() for p in pieces]
    )


def fitted(rates: Array, squares: Array) -> tuple[float, float]:
    """a (deg) and k (s) of squares = a^2 + (k rate)^2, each piece weighted by what it scatters: as its size."""
    ways, found = np.stack([np.ones_like(rates), rates**2], axis=1), np.array([0.04, 1e-6])
    for _ in range(50):
        weighed = ways / (ways @ found)[:, None] ** 2
        found = np.linalg.solve(ways.T @ weighed, weighed.T @ squares)
    return float(np.sqrt(found[0])), float(np.sqrt(found[1]))


def biases(path: Path) -> tuple[Array, Array]:
    """Mean rates (sensors, 3) of the first three seconds, deg/s, and how well their scatter says that they are known (sensors,)."""
    content = loadmat(path, simplify_cells=True)
    worn = [v for v in content.values() if isinstance(v, dict) and "gyr" in v]
    means, scatter = [], []
    for one in worn:
        n = round(100 * POSE)
        values = np.concatenate([one["gyr"], one["acc"]], axis=1)[:n, None]
        (still,) = initial_pose.held_still(
            Block(Stream("imu", ("hand",), (GYR, ACC), 100.0), np.arange(n) / 100, values)
        ).values()
        quality = initial_pose.stillness(still)
        assert quality.bias_sd is not None
        means.append(np.degrees(still.mean[:3]))
        scatter.append(np.degrees(max(quality.rate_wander / 3.0, quality.bias_sd)))
    return np.array(means), np.array(scatter)


def likeliest(means: Array, scatter: Array) -> tuple[float, float]:
    """What beside the scatter makes the means likeliest, deg/s, and the largest that is not ruled out (95 %)."""
    sizes = np.arange(0.0005, 0.08, 0.0005)
    variance = scatter[:, None] ** 2 + sizes**2
    likely = -((means**2).sum(axis=1)[:, None] / variance / 2 + 1.5 * np.log(variance)).sum(axis=0)
    return float(sizes[likely.argmax()]), float(sizes[likely > likely.max() - 1.92][-1])


def main(folder: str, file: str) -> None:
    found = [changing(broad.read(Path(folder) / f"{name}.mat")) for name in published.BROAD]
    rates, squares = (np.concatenate(x) for x in zip(*found))
    for low, high in zip(RANGES, RANGES[1:]):
        among = (rates >= low) & (rates < high)
        print(  # noqa: T201
            f"{low:3d}-{high:3d} deg/s, {among.sum():3d} pieces: vertical {np.sqrt(squares[among].mean()):.2f} deg off a level axis"
        )
    a, k = fitted(rates, squares)
    print(f"fitted: {a:.2f} deg, and {1e3 * k:.2f} ms times the rate")  # noqa: T201
    means, scatter = biases(Path(file))
    size, most = likeliest(means, scatter)
    print(  # noqa: T201
        f"biases of {len(means)} sensors: squared over the scatter's variance {np.mean((means / scatter[:, None]) ** 2):.2f}",
        end="; ",
    )
    print(  # noqa: T201
        f"beside it {size:.4f} deg/s (at most {most:.4f}), with which {np.mean(means**2 / (scatter[:, None] ** 2 + size**2)):.2f}"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
