"""filterpy beside our own where ours stays: the smoother of forces, and an update as large as the
magnet's filter's."""

import sys
import time
from collections.abc import Callable

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import ExtendedKalmanFilter, rts_smoother

from handscope.estimators.force import interpolation
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.typing import Array

ERRORS, ROWS = 58, 12  # of four magnetometers


@looped
def _corrected(P: Array, missed: Array, H: Array, noise: Array, change: Array) -> float:
    return correct(P, missed, H, noise, change)


def say(words: str) -> None:
    sys.stdout.write(f"{words}\n")


def microseconds(what: Callable[[], object], steps: int) -> float:
    """Of the processor, a step; the best of three."""
    what()
    took = []
    for _ in range(3):
        began = time.process_time()
        what()
        took.append(time.process_time() - began)
    return 1e6 * min(took) / steps


def smoother() -> None:
    """A force sensor's three axes over a minute at 100 Hz: filterpy's needs matrices, ours numbers."""
    rng, n = np.random.default_rng(0), 6000
    t, y, noise = np.arange(n) / 100, rng.normal(size=(n, 3)), 0.04

    def theirs() -> Array:
        Fs = np.tile(np.array([[1.0, 0.01], [0.0, 1.0]]), (n, 1, 1))
        Qs = [Q_continuous_white_noise(2, 0.01, 1.0) for _ in range(n)]
        x, P, H = np.zeros((n, 2, 3)), np.empty((n, 2, 2)), np.array([[1.0, 0.0]])
        x[0, 0], P[0] = y[0], np.diag([noise, 1e4])
        for k in range(1, n):
            x[k], P[k] = Fs[0] @ x[k - 1], Fs[0] @ P[k - 1] @ Fs[0].T + Qs[0]
            gain = P[k] @ H.T / (P[k, 0, 0] + noise)
            x[k] += gain * (y[k] - x[k, 0])
            P[k] -= gain @ P[k, :1]
        return np.asarray(rts_smoother(x, P, Fs, Qs)[0])

    def ours() -> Array:
        return np.moveaxis(interpolation._smooth(t, y, noise, np.ones(n - 1))[0], 1, 2)

    say(f"smoother of forces: largest difference {np.abs(theirs() - ours()).max():.1e}")
    say(
        f"  filterpy {microseconds(theirs, n):.0f} us a sample, ours {microseconds(ours, n):.0f} us"
    )


def update() -> None:
    rng = np.random.default_rng(1)
    A, H, missed = (
        rng.normal(size=(ERRORS, ERRORS)),
        rng.normal(size=(ROWS, ERRORS)),
        rng.normal(size=ROWS),
    )
    P, noise, steps = A @ A.T, np.eye(ROWS), 200
    ekf = ExtendedKalmanFilter(dim_x=ERRORS, dim_z=ROWS)
    ekf.R = noise

    def theirs() -> Array:
        for _ in range(steps):
            ekf.x, ekf.P = np.zeros((ERRORS, 1)), P.copy()
            ekf.update(missed[:, None], lambda x: H, lambda x: H @ x)
        return np.asarray(ekf.x[:, 0])

    def ours() -> Array:
        change = np.empty(ERRORS)
        for _ in range(steps):
            _corrected(P.copy(), missed, H, noise, change)
        return change

    say(
        f"update of {ERRORS} errors by {ROWS} readings: largest difference {np.abs(theirs() - ours()).max():.1e}"
    )
    say(f"  {microseconds(theirs, steps):.0f} us, ours {microseconds(ours, steps):.0f} us")


def main() -> int:
    smoother()
    update()
    return 0


if __name__ == "__main__":
    sys.exit(main())
