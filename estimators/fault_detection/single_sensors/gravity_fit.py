"""What the standing still of gravity says of a gyroscope: the matrix between its readings and the accelerometer's turning, with its covariance.

In      windows of gravity_windows.py, made with the matrix that is judged
Out     corrections to matrix, biases, lever arm and delay with covariance; log-likelihood of the windows, chain by chain
Source  multivariate t of each chain's residuals, its scale profiled (Lange, Little & Taylor 1989, JASA 84:881); evidence of models with free corrections
        by Laplace's approximation (MacKay 1992, Neural Comput 4:415); sizes below ours
Limits  accelerations that come back with every repetition of a movement do not average out: REPEATED of the residual's power is taken to do so
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.single_sensors.cells import Cells
from handscope.estimators.fault_detection.single_sensors.fit_kernels import fit_chains
from handscope.estimators.fault_detection.single_sensors.gravity_windows import (
    MATRIX,
    PARAMETERS,
    Windows,
    windows_of,
)
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

FLOOR = 0.04  # m/s^2 of a window's mean that scale and axes of the accelerometer, 0.3 to 0.5 % off, make wrong
DRIFT = 0.005  # of the path turned, that a gyroscope sampled at 100 Hz turns wrong
LONGEST = 25.0  # rad in a chain: hands seldom turn further
UNSURE = 0.6  # m/s^2 that the mean specific force of a chain may differ from gravity's size: bias, and velocity gained in 5 s
FREEDOM = 2.0  # degrees of freedom of the t distribution: how unlike chains are
SHARE = 0.7  # independent residuals a window and axis: neighbours overlap by half
REPEATED = 0.5  # of the residual's power that comes back with the movement, so that it does not average out over chains
SAME_SD, SAME_DELAY = (
    0.03,
    0.02,
)  # of a matrix and a delay (s) that are as they should be: calibration, axes not quite at right angles
FREE_SD, FREE_DELAY = 0.5, 0.2  # of those that are off
BIAS_SD, ACC_BIAS_SD, ARM_SD = 0.1, 0.15, 0.1  # rad/s, m/s^2, m
STRAIGHT = 0.5  # rad: turns up to which what is wrong with them adds up
ROUNDS = 8


@dataclass(frozen=True)
class Information:
    """Normal equations of every chain (G) and sensor (S), the residual last."""

    N: Array  # (G, S, PARAMETERS + 1, PARAMETERS + 1)
    n: Array  # (G, S) independent residuals
    floor: Array  # (G, S) (m/s^2)^2, sum of squares that a right matrix leaves without any acceleration
    path: Array  # (G, S) rad

    def part(
        self, chains: slice, sensors: "slice | NDArray[np.intp]" = slice(None)
    ) -> "Information":
        """Of some chains and sensors only."""
        return Information(
            self.N[chains][:, sensors],
            self.n[chains][:, sensors],
            self.floor[chains][:, sensors],
            self.path[chains][:, sensors],
        )


@dataclass(frozen=True)
class Fit:
    """Corrections to what the windows were made with, by sensor."""

    x: Array  # (S, PARAMETERS) in the order of gravity_windows.py
    cov: Array  # (S, PARAMETERS, PARAMETERS), what repeats with the movement included
    likelihood: Array  # (G, S) logarithm, of each chain at the best corrections
    cost: Array  # (S,) logarithm: what freedom of the corrections costs
    repeats: Array  # (S,) by how much evidence counts less, because errors repeat with the movement

    @property
    def matrix(self) -> Array:
        """Correction (S, 3, 3) to M."""
        return self.x[:, MATRIX].reshape(-1, 3, 3)

    @property
    def evidence(self) -> Array:
        """Logarithm of the evidence (S,) of all chains together."""
        return np.asarray(self.likelihood.sum(axis=0) + self.cost)


def priors(directions: Array | None = None, delay: bool = False) -> Array:
    """Covariance (PARAMETERS, PARAMETERS) of the corrections before anything is measured.

    Parameters
    ----------
    directions : Array, optional
        (9, k) along which the matrix, row by row, may be off; none where absent.
    delay : bool
        Whether the gyroscope may be late or early.
    """
    sd = np.repeat(
        [SAME_SD, BIAS_SD, ACC_BIAS_SD, ARM_SD, FREE_DELAY if delay else SAME_DELAY],
        (9, 3, 3, 3, 1),
    )
    out: Array = np.diag(sd**2)
    if directions is not None:
        out[MATRIX, MATRIX] += FREE_SD**2 * directions @ directions.T
    return np.asarray(out)


SAME = priors()


def information_of(windows: Windows) -> Information:
    """Normal equations of windows about their chain's mean force, which is free."""
    G, S, K = windows.valid.shape
    A = (
        np.concatenate([windows.slope, windows.force[..., None]], axis=-1)
        * windows.valid[..., None, None]
    )
    count = windows.valid.sum(axis=-1)
    A -= A.sum(axis=2, keepdims=True) / np.maximum(count, 1)[..., None, None, None]
    A = (A * windows.valid[..., None, None]).reshape(G, S, 3 * K, -1)
    N, n = np.swapaxes(A, -1, -2) @ A, 3 * SHARE * np.maximum(count - 1, 0)
    N[..., -1, -1] += count * _wrong_size(windows)
    return Information(N, n, (FREEDOM + n) * _expected(windows), windows.path)


def fit(information: Information, prior: Array = SAME) -> Fit:
    """Most likely corrections of every sensor.

    Parameters
    ----------
    information : Information
        Of the chains that count.
    prior : Array
        (PARAMETERS, PARAMETERS) covariance of the corrections, of `priors`.

    Returns
    -------
    Fit
        Corrections in the order of gravity_windows.py.
    """
    N, n = information.N, information.n
    prior = np.where(
        information.path.max(axis=0, initial=0.0)[:, None, None] * SAME_SD > STRAIGHT,
        _narrowed(prior, information),
        prior,
    )
    x, cov, spread, cost, share = fit_chains(
        *(np.ascontiguousarray(a) for a in (N, n, information.floor)), prior, FREEDOM, ROUNDS
    )
    likelihood = -0.5 * (FREEDOM + n) * np.log(spread / ((FREEDOM + n) * FLOOR**2)) * (n > 0)
    repeats = 1.0 + REPEATED * share.sum(axis=0) ** 2 / np.maximum((share**2).sum(axis=0), 1e-12)
    return Fit(x, cov * repeats[:, None, None], likelihood, cost, repeats)


def _narrowed(prior: Array, information: Information) -> Array:
    """Priors (S, PARAMETERS, PARAMETERS) that leave a matrix only what adds up over the path turned."""
    width = np.ones((information.n.shape[1], PARAMETERS))
    width[:, MATRIX] = np.minimum(
        1.0, STRAIGHT / (SAME_SD * np.maximum(information.path.max(axis=0, initial=0.0), 1e-9))
    )[:, None]
    return np.asarray(width[:, :, None] * prior * width[:, None])


def likelihood_of(windows: Windows) -> Array:
    """Log-likelihood (G, S) of windows as they are: no bias, no lever arm, slopes not needed."""
    count = windows.valid.sum(axis=-1)
    n = 3 * SHARE * np.maximum(count - 1, 0)
    force = windows.force * windows.valid[..., None]
    mean = force.sum(axis=2) / np.maximum(count, 1)[..., None]
    squares = (
        (force**2).sum(axis=(2, 3)) - count * (mean**2).sum(axis=-1) + count * _wrong_size(windows)
    )
    floor = _expected(windows)
    return np.asarray(
        -0.5
        * (FREEDOM + n)
        * np.log((np.maximum(squares, 0.0) / (FREEDOM + n) + floor) / FLOOR**2)
        * (n > 0)
    )


def likelihoods_of(cells: Cells, matrices: Array) -> Array:
    """That of all sensors (H, G, S) with each of several matrices (H, 3, 3)."""
    H, S = len(matrices), len(cells.sensors)
    M, columns = np.repeat(matrices, S, axis=0), np.tile(np.arange(S), H)
    found = likelihood_of(windows_of(cells, M, False, columns=columns))
    return np.moveaxis(found.reshape(-1, H, S), 1, 0)


def _wrong_size(windows: Windows) -> Array:
    """Square (G, S) by which the chains' mean force differs from gravity's size: a frame that turns wrong averages it away."""
    count = np.maximum(windows.valid.sum(axis=-1), 1)[..., None]
    mean = (windows.force * windows.valid[..., None]).sum(axis=2) / count
    return np.asarray(
        np.maximum(np.abs(np.linalg.norm(mean, axis=-1) - GRAVITY) - UNSURE, 0.0) ** 2
    )


def _expected(windows: Windows) -> Array:
    """Mean square (G, S) that a right matrix leaves without any acceleration."""
    return np.asarray(FLOOR**2 + (DRIFT * GRAVITY * np.minimum(windows.path, LONGEST)) ** 2)
