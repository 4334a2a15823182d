"""What is held: parameters of a linear model, by weighted least squares of all samples at once and by recursive least squares that forgets.

In      y (n, m) and H (n, m, p) with y = H theta + e, standard deviation of e (n,)
Out     theta (p,), its covariance: scaled by the residuals, with samples of correlated errors counted as one
Source  Kortier, thesis (6.7), (6.8); recursive least squares with forgetting: the thesis' [64], Gustafsson 2010, Statistical Sensor
        Fusion
        Models: mass f_i + f_t = M (g + a) (6.5); spring and damper (f_t - f_i) . e / 2 = K (p0 - p) - D v with e from i to t and p the tips' distance. (6.6) writes
        the difference itself, of two springs in a row (Fig. 6.3); ours is half of it, so that K is that of the whole, as a spring is bought
Limits  errors in H bias theta towards zero; an error that is the same in all samples (zero, scale, inclination) is not seen here: whoever calls adds it
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.numerics.typing import Array

KNOWN = 0.5  # standard deviation over value below which a running estimate is reported
VAGUE = 1e8  # prior variance, in units of the square of each parameter's usual size


@dataclass(frozen=True)
class Fit:
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
    """Nothing known; `size` (p,) is how large the parameters may be."""
    prior = VAGUE * np.asarray(size, float) ** 2
    return RecursiveLeastSquares(np.zeros(len(size)), np.diag(prior), prior)


def update(
    state: RecursiveLeastSquares, t: float, y: Array, H: Array, sd: float, memory: float = np.inf
) -> RecursiveLeastSquares:
    """One sample y (m,), H (m, p): what is `memory` s old counts for 1/e."""
    keep = float(np.exp(-(t - state.t) / memory)) if np.isfinite(state.t) else 1.0
    P = (
        state.P / keep if (np.diag(state.P) <= keep * state.most).all() else state.P
    )  # what no sample tells is forgotten only so far
    S = H @ P @ H.T + sd**2 * np.eye(len(y))
    innovation = y - H @ state.theta
    gain = np.linalg.solve(S, H @ P).T
    left = np.eye(len(P)) - gain @ H
    P = (
        left @ P @ left.T + sd**2 * gain @ gain.T
    )  # Joseph's form: from a prior this vague the plain one ends below zero
    P = 0.5 * (P + P.T)
    share = 1 - keep if np.isfinite(memory) else 0.05
    nis = state.nis + max(share, 0.02) * (
        float(innovation @ np.linalg.solve(S, innovation)) / len(y) - state.nis
    )
    return replace(state, theta=state.theta + gain @ innovation, P=P, nis=nis, t=t)


def run_recursive(
    state: RecursiveLeastSquares, t: Array, y: Array, H: Array, sd: Array, memory: float = np.inf
) -> tuple[RecursiveLeastSquares, Array, Array]:
    """Samples in a row: the state behind them, theta and its standard deviations (n, p) after each; cut anywhere, the same."""
    track, spread = np.empty((len(t), len(state.theta))), np.empty((len(t), len(state.theta)))
    for k in range(len(t)):
        state = update(state, float(t[k]), y[k], H[k], float(sd[k]), memory)
        track[k], spread[k] = state.theta, state.sd
    return state, track, spread


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
    """The first parameter by recursive least squares; `sd` counts samples that err alike as one, `correlated` (of values) is what errs the same in all of them."""
    _, track, spread = run_recursive(initial_state(size), t, y, H, np.full(len(t), sd), memory)
    value = track[:, 0]
    total = np.hypot(spread[:, 0], common_sd(value))
    known = total < KNOWN * np.abs(value)
    return RunningEstimate(t, np.where(known, value, np.nan), np.where(known, total, np.nan))
