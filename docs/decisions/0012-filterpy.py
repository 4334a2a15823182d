"""filterpy beside our own: recursive least squares that forget, and an update as large as the magnet's filter's. Needs `pip install filterpy`."""

import sys
import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter  # type: ignore[import-not-found]

from handscope.estimators.force import identification
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.typing import Array

N, STEP, MEMORY, NOISE = 500, 0.02, 1.0, 0.1
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


def least_squares() -> None:
    rng, t = np.random.default_rng(0), STEP * np.arange(N)
    H = np.stack([np.sin(3 * t), np.cos(3 * t)], axis=-1)[:, None]
    y = H @ np.array([2.0, -0.5]) + NOISE * rng.normal(size=(N, 1))

    def theirs() -> Array:
        kf = KalmanFilter(dim_x=2, dim_z=1)
        kf.P, kf.R, kf.Q, kf.F = (
            identification.VAGUE * np.eye(2),
            np.array([[NOISE**2]]),
            np.zeros((2, 2)),
            np.eye(2),
        )
        kf.alpha = np.exp(STEP / MEMORY / 2)
        for k in range(N):
            if k:
                kf.predict()
            kf.update(y[k], H=H[k])
        return np.asarray(kf.x[:, 0])

    def ours() -> Array:
        begun = identification.initial_state(np.ones(2))
        return identification.run_recursive(begun, t, y, H, np.full(N, NOISE), MEMORY)[0].theta

    say(f"recursive least squares: filterpy {theirs()}, ours {ours()}")
    say(f"  {microseconds(theirs, N):.0f} us a sample, ours {microseconds(ours, N):.0f} us")


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
    least_squares()
    update()
    return 0


if __name__ == "__main__":
    sys.exit(main())
