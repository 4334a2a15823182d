"""How fingertips that hold something are turned against each other, without magnetometers: gravity, balance of the forces, and moving together.

In      of S tips with force and inertial sensor on one cuff: orientation q_GF (n, S, 4) as the method estimates it, force (n, S, 3) N, specific force (n, S, 3)
        and angular rate (n, S, 3) in the cuff's frame F; which instants belong to one grasp
Out     the turn to be put before q_GF (n, S, 3) rad in the global frame, its covariance (n, 3S, 3S), by how much the forces do not balance
Source  Kortier, thesis 6.2.2, (6.13), (6.14), gates after Skog et al. 2010. The error state is the turn of every tip, a random walk, and, ours, how each cuff
        holds its force sensor turned against its inertial sensor, a constant; filtered and smoothed.
        Ours: (6.13) holds the part of the net force across the specific force, not only while the hand is still: f_i + f_t = M (g + a) lies along it
Limits  a turn about the line between the tips that both share, and the heading of both, cannot be seen; errors that stay constant (biases, scales) count as white
        noise of as much more variance
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.options import option
from handscope.estimators.data.samples import every
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180


@dataclass(frozen=True, kw_only=True)
class TipParams:
    """Options of the correction of the fingertips' orientations."""

    tip_sd: float = option(
        4.0,
        "deg",
        "turn of a tip as the method tells it, in each axis",
        "docs/validation: 3.2 deg of the thumb's base, 1.8 of fingers",
        least=0.1,
    )
    cuff_sd: float = option(
        1.0,
        "deg",
        "turn of the force sensor against the inertial sensor on its cuff, in each axis",
        "3D print; ours",
        least=0.0,
    )
    tip_walk: float = option(
        0.2, "deg/sqrt(s)", "how that error wanders", "ours: skin and sensor under load", least=1e-3
    )
    acc_error: float = option(
        0.1,
        "m/s^2",
        "error of an accelerometer axis that stays alike, as is likely; more or less where sensors at rest show it",
        "ours: bias of 0.05 and scale of 0.3 %",
        least=1e-3,
    )
    acc_error_time: float = option(
        10.0,
        "s",
        "time over which such errors stay the same",
        "ours: longer than a grasp",
        least=0.1,
        earlier="alike",
    )
    still: float = option(
        0.5, "m/s^2", "deviation from gravity of a tip that tells the vertical", "ours", least=0.01
    )
    still_rate: float = option(30.0, "deg/s", "angular rate of such a tip", "ours", least=0.1)
    together: float = option(
        0.5,
        "m/s^2",
        "difference of the sizes of specific force of tips that move together",
        "Kortier thesis (2.27); size ours",
        least=0.01,
    )
    together_rate: float = option(
        10.0,
        "deg/s",
        "and of their angular rates",
        "Kortier thesis (6.14), Skog et al. 2010; size ours",
        least=0.1,
    )
    force_noise: float = option(
        0.1, "N", "error of a force, in each axis", "ours: noise and zero", least=1e-3
    )
    force_scale: float = option(
        0.025,
        "1",
        "share of a force by which it may be wrong",
        "BioMed Eng OnLine 11:90, Table 4: 0 to 4 % of full scale",
        least=0.0,
    )
    update: float = option(0.05, "s", "time between two corrections", "ours", least=0.005, most=1.0)


@dataclass(frozen=True)
class OrientationCorrection:
    """Rotation of each tip, rad, with its covariance, rad^2."""

    turn: Array  # (n, S, 3) rad, of the force sensors
    covariance: Array  # (n, 3S, 3S) of it
    inertial: Array  # (n, S, 3) rad, of the inertial sensors on the same cuffs
    unbalanced: Array  # (n,) force across gravity left over, in standard deviations


@dataclass(frozen=True)
class Tips:
    """What is known of S tips at n instants."""

    t: Array  # (n,) s
    q_GF: Array  # (n, S, 4)
    force: Array  # (n, S, 3) N, NaN where not known
    acc: Array  # (n, S, 3) m/s^2, NaN where there is no inertial sensor
    gyr: Array  # (n, S, 3) rad/s


def correct_orientations(params: TipParams, tips: Tips) -> OrientationCorrection:
    """The turns of one grasp."""
    S = tips.force.shape[1]
    rows = _update_rows(tips.t, params.update)
    walk = np.repeat([(params.tip_walk * DEG) ** 2, 0.0], 3 * S)
    x, P = (
        np.zeros(6 * S),
        np.diag(np.repeat([(params.tip_sd * DEG) ** 2, (params.cuff_sd * DEG) ** 2], 3 * S)),
    )
    states, covariances, ahead = [], [], []
    before = tips.t[rows[0]]
    for k in rows:
        P = P + np.diag(walk * (tips.t[k] - before))
        ahead.append(P)
        for missed, H, R in _measurements(params, tips, k, x):
            gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            x = x + gain @ missed
            P = P - gain @ H @ P
            P = 0.5 * (P + P.T)
        states.append(x)
        covariances.append(P)
        before = tips.t[k]
    for j in range(len(rows) - 2, -1, -1):
        G = np.linalg.lstsq(ahead[j + 1], covariances[j], rcond=None)[0].T
        states[j] = states[j] + G @ (states[j + 1] - states[j])
        covariances[j] = covariances[j] + G @ (covariances[j + 1] - ahead[j + 1]) @ G.T
    return _interpolate_states(tips, rows, np.array(states), np.array(covariances), params)


def _interpolate_states(
    tips: Tips, rows: NDArray[np.int_], states: Array, covariances: Array, params: TipParams
) -> OrientationCorrection:
    """From the rows at which something was corrected to all instants."""
    n, S = tips.force.shape[:2]
    x = np.stack([np.interp(tips.t, tips.t[rows], s) for s in states.T], axis=1)
    inertial, cuff = x[:, : 3 * S].reshape(n, S, 3), x[:, 3 * S :].reshape(n, S, 3)
    q = quat.multiply(quat.exp(inertial), tips.q_GF)
    turn = quat.log(quat.multiply(quat.multiply(q, quat.exp(cuff)), quat.conjugate(tips.q_GF)))
    whole = np.concatenate([np.tile(np.eye(3 * S), (n, 1, 1)), _turns_in_global(q)], axis=2)
    nearest = np.searchsorted(rows, np.arange(n)).clip(0, len(rows) - 1)
    covariance = whole @ covariances[nearest] @ whole.transpose(0, 2, 1)
    return OrientationCorrection(
        turn, covariance, inertial, _unbalanced_force(params, tips, turn, covariance)
    )


def _turns_in_global(q: Array) -> Array:
    """Turns of S tips' own frames, one after the other, in the global one: (..., S, 4) -> (..., 3S, 3S)."""
    S = q.shape[-2]
    R, turned = quat.matrix(q), np.zeros((*q.shape[:-2], 3 * S, 3 * S))
    for s in range(S):
        turned[..., 3 * s : 3 * s + 3, 3 * s : 3 * s + 3] = R[..., s, :, :]
    return turned


def _measurements(
    params: TipParams, tips: Tips, k: int, x: Array
) -> list[tuple[Array, Array, Array]]:
    """What is missed, its Jacobian and noise, of everything that may be used at row k."""
    S, used = tips.force.shape[1], []
    turn, cuff = x[: 3 * S].reshape(S, 3), x[3 * S :].reshape(S, 3)
    q = quat.multiply(quat.exp(turn), tips.q_GF[k])
    acc, gyr, force = (
        quat.rotate(q, tips.acc[k]),
        quat.rotate(q, tips.gyr[k]),
        quat.rotate(q, quat.rotate(quat.exp(cuff), tips.force[k])),
    )
    samples = params.acc_error_time / params.update
    own = np.flatnonzero(every(np.isfinite(acc)) & every(np.isfinite(gyr)))
    size, rate = np.linalg.norm(acc, axis=1), np.linalg.norm(gyr, axis=1)
    for s in (int(one) for one in own):
        if abs(size[s] - GRAVITY) < params.still and rate[s] < params.still_rate * DEG:
            used.append(
                (
                    np.array([0.0, 0.0, size[s]]) - acc[s],
                    _sum_jacobian(S, {s: acc[s]}),
                    np.eye(3) * params.acc_error**2 * samples,
                )
            )
    if (
        S > 1
        and len(own) == S
        and np.ptp(size) < params.together
        and np.ptp(rate) < params.together_rate * DEG
    ):
        for s in range(1, S):
            # the tips' lever arms make their specific forces differ as the hand turns: so much more noise
            lever = 0.1 * max(rate[0], rate[s]) ** 2
            used.append(
                (
                    acc[0] - acc[s],
                    _sum_jacobian(S, {s: acc[s], 0: -acc[0]}),
                    np.eye(3) * ((2 * params.acc_error**2) * samples + lever**2),
                )
            )
            used.append(
                (
                    gyr[0] - gyr[s],
                    _sum_jacobian(S, {s: gyr[s], 0: -gyr[0]}),
                    np.eye(3) * (0.5 * params.together_rate * DEG) ** 2 * samples,
                )
            )
    # the cuff turns what the force sensor reads alone
    used = [(missed, np.hstack([H, np.zeros_like(H)]), R) for missed, H, R in used]
    if len(own) and np.isfinite(force).all():
        up = acc[own].mean(axis=0)
        across = _horizontal_axes(up)
        noise = S * params.force_noise**2 + params.force_scale**2 * float((force**2).sum())
        H = across @ _sum_jacobian(S, {s: force[s] for s in range(S)})
        tilted = H.copy()  # the vertical is the tips' own: it turns with them
        for s in (int(one) for one in own):
            tilted[:, 3 * s : 3 * s + 3] += np.cross(across, force.sum(axis=0)) / len(own)
        used.append(
            (
                -across @ force.sum(axis=0),
                np.hstack([tilted, H @ _turns_in_global(q)]),
                np.eye(2) * noise * samples,
            )
        )
    return used


def _sum_jacobian(S: int, vectors: dict[int, Array]) -> Array:
    """How the sum of global vectors (3,) of some tips changes with their turns: (3, 3S); a turn d adds d x v."""
    H = np.zeros((3, 3 * S))
    for s, v in vectors.items():
        H[:, 3 * s : 3 * s + 3] = -quat.skew(v)
    return H


def _horizontal_axes(up: Array) -> Array:
    """Two unit vectors (2, 3) at right angles to `up`."""
    e = up / np.linalg.norm(up)
    first = np.cross(e, np.eye(3)[np.argmin(np.abs(e))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(e, first)])


def _unbalanced_force(params: TipParams, tips: Tips, turn: Array, covariance: Array) -> Array:
    """The net force across the specific force (n,), in standard deviations of what forces and turns may be wrong by."""
    S = tips.force.shape[1]
    q = quat.multiply(quat.exp(turn), tips.q_GF)
    force, acc = quat.rotate(q, tips.force), quat.rotate(q, tips.acc)
    read = np.isfinite(acc)
    with np.errstate(invalid="ignore"):
        up = (
            np.where(read, acc, 0.0).sum(axis=1) / read.sum(axis=1)
            if read.any()
            else np.tile([0.0, 0.0, 1.0], (len(tips.t), 1))
        )
        up = up / np.linalg.norm(up, axis=1, keepdims=True)
    net = force.sum(axis=1)
    net = net - (net * up).sum(axis=1, keepdims=True) * up
    H = np.concatenate([-quat.skew(force[:, s]) for s in range(S)], axis=2)
    turned = np.einsum("nij,njk,nik->n", H, covariance, H) / 3
    variance = (
        S * params.force_noise**2 + params.force_scale**2 * (force**2).sum(axis=(1, 2)) / 3 + turned
    )
    return np.asarray(np.linalg.norm(net, axis=1) / np.sqrt(variance))


def _update_rows(t: Array, update: float) -> NDArray[np.int_]:
    """The rows at which something is corrected: one in each stretch of `update` s."""
    return np.unique(np.searchsorted(t, np.arange(t[0], t[-1] + 1e-9, update)).clip(0, len(t) - 1))
