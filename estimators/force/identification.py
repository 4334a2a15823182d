"""Identification of the held object: parameters of a linear model, by weighted least squares and by recursive least squares with forgetting.

In      y (n, m) and H (n, m, p) with y = H theta + e, standard deviation of e (n,)
Out     theta (p,), its covariance: scaled by the residuals, with samples of correlated errors counted as one
Source  Kortier, thesis (6.7), (6.8); recursive least squares with forgetting: the thesis' [64], Gustafsson 2010, Statistical Sensor
        Fusion; filterpy's Kalman filter with fading memory
        Models: mass f_i + f_t = M (g + a) (6.5); spring and damper (f_t - f_i) . e / 2 = K (p0 - p) - D v with e from i to t and p the tips' distance. (6.6) writes
        the difference itself, of two springs in a row (Fig. 6.3); ours is half of it, so that K is that of the whole, as a spring is bought
Limits  errors in H bias theta towards zero; an error that is the same in all samples (zero, scale, inclination) is not in the covariance: the caller adds it
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from handscope.estimators.numerics.typing import Array

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

KNOWN = 0.5  # standard deviation over value below which a running estimate is reported
VAGUE = 1e8  # prior variance, in units of the square of each parameter's usual size


@dataclass(frozen=True)
class Fit:
    """Parameters of a linear model with their covariance, and the residuals."""

    theta: Array  # (p,)
    covariance: Array  # (p, p)
    residuals: Array  # (n, m)
    independent: float  # of the n samples, as many count as independent

    @property
    def sd(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


def fit_least_squares(y: Array, H: Array, sd: Array) -> Fit:
    """All samples at once (6.8); needs more equations than parameters and H of full rank."""
    n, m, p = H.shape
    weight = 1 / sd[:, None, None]
    A, b = (H * weight).reshape(n * m, p), (y[..., None] * weight).reshape(n * m)
    N = A.T @ A
    theta: Array = np.asarray(np.linalg.solve(N, A.T @ b), float)
    left = y - H @ theta
    scaled = left / sd[:, None]
    variance = max(1.0, float((scaled**2).sum() / max(n * m - p, 1)))
    correlated = max(_correlated_samples(scaled[:, k]) for k in range(m))
    return Fit(
        theta, np.asarray(np.linalg.inv(N) * variance * correlated, float), left, n / correlated
    )


def _correlated_samples(r: Array) -> float:
    """Number of consecutive samples with correlated errors: the sum of the autocorrelation until it first vanishes."""
    r = r - r.mean()
    power = float(r @ r)
    if len(r) < 8 or power <= 0:
        return 1.0
    size = 1 << (2 * len(r) - 1).bit_length()
    spectrum = np.fft.rfft(r, size)
    correlation = np.fft.irfft(spectrum * spectrum.conj(), size)[: len(r) // 2] / power
    gone = np.flatnonzero(correlation <= 0)
    return float(max(1.0, 1 + 2 * correlation[1 : gone[0] if len(gone) else None].sum()))


@dataclass(frozen=True)
class RecursiveLeastSquares:
    """Recursive least squares: everything that the next sample needs."""

    theta: Array  # (p,)
    P: Array  # (p, p) covariance where the samples' standard deviations are right
    most: Array  # (p,) variances beyond which nothing more is forgotten
    nis: float = 1.0  # mean of the squared innovation in its standard deviation, over as long as is remembered
    t: float = -np.inf

    @property
    def sd(self) -> Array:
        """Standard deviations, enlarged where the innovations are larger than expected."""
        return np.sqrt(np.diag(self.P) * max(1.0, self.nis))


def initial_state(size: Array) -> RecursiveLeastSquares:
    """The state before any sample: a vague prior around parameters of `size` (p,)."""
    prior = VAGUE * np.asarray(size, float) ** 2
    return RecursiveLeastSquares(np.zeros(len(size)), np.diag(prior), prior)


def update(
    state: RecursiveLeastSquares, t: float, y: Array, H: Array, sd: float, memory: float = np.inf
) -> RecursiveLeastSquares:
    """Update by one sample y (m,), H (m, p); a sample `memory` s old has the weight 1/e."""
    return run_recursive(state, np.array([t]), y[None], H[None], np.array([sd]), memory)[0]


def run_recursive(
    state: RecursiveLeastSquares, t: Array, y: Array, H: Array, sd: Array, memory: float = np.inf
) -> tuple[RecursiveLeastSquares, Array, Array]:
    """Samples in a row: the state behind them, theta and its standard deviations (n, p) after each; cut anywhere, the same."""
    p, m = len(state.theta), y.shape[1]
    fading = _fading_filter(state, m)
    track, spread = np.empty((len(t), p)), np.empty((len(t), p))
    for k in range(len(t)):
        keep = float(np.exp(-(t[k] - state.t) / memory)) if np.isfinite(state.t) else 1.0
        within = (np.diag(fading.P) <= keep * state.most).all()
        fading.alpha = 1 / np.sqrt(keep) if within else 1.0  # without samples: forgotten so far
        fading.predict()
        fading.update(y[k], R=sd[k] ** 2, H=H[k])
        fading.P = 0.5 * (fading.P + fading.P.T)
        nis = (fading.y.T @ fading.SI @ fading.y).item() / m
        share = max(1 - keep if np.isfinite(memory) else 0.05, 0.02)
        state = replace(
            state,
            theta=fading.x[:, 0],
            P=fading.P,
            nis=state.nis + share * (nis - state.nis),
            t=float(t[k]),
        )
        track[k], spread[k] = state.theta, state.sd
    return state, track, spread


def _fading_filter(state: RecursiveLeastSquares, m: int) -> "KalmanFilter":
    """Recursive least squares as a Kalman filter of constants with fading memory."""
    from filterpy.kalman import KalmanFilter  # here: it imports scipy.stats, 0.3 s

    fading = KalmanFilter(dim_x=len(state.theta), dim_z=m)
    fading.x, fading.P = state.theta[:, None], state.P
    fading.F, fading.Q = np.eye(len(state.theta)), np.zeros_like(state.P)
    return fading


@dataclass(frozen=True)
class RunningEstimate:
    """One parameter as it stood after each of n samples; NaN where nothing was known yet."""

    t: Array  # (n,) s
    value: Array  # (n,)
    sd: Array  # (n,)


def track_first_parameter(
    t: Array,
    y: Array,
    H: Array,
    sd: float,
    size: Array,
    memory: float,
    common_sd: Callable[[Array], Array],
) -> RunningEstimate:
    """The first parameter by recursive least squares; `sd` counts samples with correlated errors as one, `correlated` (a share of the values) is an error common to all."""
    _, track, spread = run_recursive(initial_state(size), t, y, H, np.full(len(t), sd), memory)
    value = track[:, 0]
    total = np.hypot(spread[:, 0], common_sd(value))
    known = total < KNOWN * np.abs(value)
    return RunningEstimate(t, np.where(known, value, np.nan), np.where(known, total, np.nan))
