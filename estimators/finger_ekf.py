"""Joint rotations of the fingers and the biases of their gyroscopes: an error-state filter a finger, all fingers one batch.

In      what the sensors of hand, proximal, middle and distal phalanx turned by since the sample before, and their specific forces, in segment frames
Out     q_pc of HP, PM, MD at every sample, with the covariance of their errors dth: q_true = q_pc exp(dth)
Source  Kortier, thesis ch. 2: state (2.3), (2.5); errors (2.15)-(2.22); his q^{ij} is our q_pc with i = p, j = c. Between updates the turns of the
        sensors are summed up with their change by the biases, as in Forster et al. 2017 (IEEE Trans Robot 33:1), exactly for piecewise constant rates
Limits  noise that is correlated in time is taken as white noise that is larger, a joint's constant play is considered but not estimated; the fingers' filters
        each know the hand's bias for themselves; ranges of motion are not used, so the heading of the thumb's CMC drifts with the biases
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import ekf_updates
from estimators import quaternions as quat
from estimators.ekf_updates import FORBIDS, UpdateParams
from estimators.options import option
from estimators.quaternions import Array

ANGLES, BIASES, PLAY = slice(0, 9), slice(9, 21), slice(21, 27)
EYE = np.eye(27)


@dataclass(frozen=True, kw_only=True)
class FilterParams(UpdateParams):
    update: float = option(0.05, "s", "time between two updates; the gyroscopes count at every sample", "ours: movement is below 10 Hz")
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet; Kortier's Table 2.1 has 5e-4 rad/s at 200 Hz, a tenth of it",
        least=1e-6,
    )
    gyr_scale: float = option(0.003, "1", "scale error of a gyroscope axis", "ours: left after a calibration on a turntable")
    bias_walk: float = option(1e-4, "rad/s/sqrt(s)", "random walk of a gyroscope's bias", "Kortier thesis, Table 2.1")
    bias_sd: float = option(
        0.1, "deg/s", "what the pose leaves of a gyroscope's bias", "ours: 0.3 deg of turning unseen in a pose of 3 s", least=1e-6
    )
    angle_sd: float = option(
        0.5, "deg", "noise of a joint's rotation in the pose", "ours: 0.05 m/s^2 of accelerometer bias at rest", least=1e-6
    )
    correlation: float = option(
        1.0, "s", "time over which errors of accelerometers, joints and scales stay alike", "ours: half a movement", least=0.0
    )


@dataclass(frozen=True)
class Samples:
    """Aligned samples of F fingers; the four sensors are those of the hand and the three phalanges."""

    t: Array  # (n,) s
    turn: Array  # (n, F, 4, 3) rad, rotation since the sample before as a vector in the segment's frame; 0 where nothing is known
    bias_time: Array  # (n, F, 4) s of the gyroscope's bias that is in `turn`
    acc: Array  # (n, F, 4, 3) m/s^2; NaN where it must not be used
    doubt: Array  # (n, F, 4) rad^2, variance of what `turn` may have missed
    known: NDArray[np.bool_]  # (n, F, 3) both segments of the joint are measured
    q_first: Array  # (n, F, 3, 4) q_pc to start a joint from that was not known before

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    q_pc: Array  # (F, 3, 4) at the newest update
    bias: Array  # (F, 4, 3) rad/s
    P: Array  # (F, 27, 27) covariance of [dth_HP, dth_PM, dth_MD, db_H, db_P, db_M, db_D] and of the joints' constant play, which is not estimated
    known: NDArray[np.bool_]  # (F, 3) the joint has a rotation
    forbids: NDArray[np.bool_]  # (F, 3, 2) pronation and deviation that the joint does not have
    t: float  # s, newest update; -inf before the first sample
    newest: float  # s, newest sample
    turned: Array  # (F, 4, 4) what the sensors have turned by since
    turns: Array  # (m, F, 4, 3) rad, of the samples since, biases removed
    after: Array  # (m, F, 4, 4) `turned` after each of them
    bias_time: Array  # (m, F, 4) s
    doubt: Array  # (m, F, 4) rad^2


@dataclass(frozen=True)
class Estimate:
    q_pc: Array  # (n, F, 3, 4)
    P: Array  # (n, F, 9, 9) rad^2, of the three joints' errors, as of the newest update


def start(params: FilterParams, forbids: NDArray[np.bool_] = FORBIDS) -> State:
    """Nothing known but the size of the biases; the first sample with a joint's two segments starts it."""
    fingers = len(forbids)
    P = np.zeros((fingers, 27, 27))
    P[:, range(9, 21), range(9, 21)] = np.radians(params.bias_sd) ** 2
    P[:, range(9), range(9)] = np.radians(params.angle_sd) ** 2
    P[:, range(21, 27), range(21, 27)] = np.radians(params.dimension_sd) ** 2
    q_pc, still = np.tile(quat.IDENTITY, (fingers, 3, 1)), np.tile(quat.IDENTITY, (fingers, 4, 1))
    known = np.zeros((fingers, 3), bool)
    return State(q_pc, np.zeros((fingers, 4, 3)), P, known, forbids, -np.inf, -np.inf, still, *_nothing(fingers))


def step(params: FilterParams, state: State, samples: Samples) -> tuple[State, Estimate]:
    """Advance by samples of any number, 0 included: nothing depends on where they are cut."""
    n, fingers = len(samples), len(state.q_pc)
    given = Estimate(np.empty((n, fingers, 3, 4)), np.empty((n, fingers, 9, 9)))
    first = 0
    while first < n:
        if not np.array_equal(state.known, samples.known[first]):
            state = _started(params, state, samples, first)
        last, closes = _window(params, state, samples, first)
        state = _turned(state, samples, first, last)
        given.P[first:last] = state.P[:, ANGLES, ANGLES]
        given.q_pc[first:last] = carried(state.q_pc, state.after[len(state.after) - (last - first) :])
        if closes:
            state = _updated(params, state, samples, last - 1)
            given.q_pc[last - 1], given.P[last - 1] = state.q_pc, state.P[:, ANGLES, ANGLES]
        first = last
    return state, given


def carried(q_pc: Array, turned: Array) -> Array:
    """Joint rotations (..., 3, 4) after the four sensors have turned by (..., 4, 4): exp(-w_p dt) q exp(w_c dt). (2.3) with (2.17), exact"""
    return quat.normalize(quat.multiply(quat.multiply(quat.conjugate(turned[..., :3, :]), q_pc), turned[..., 1:, :]))


def transition(q_new: Array, turned: Array, by_bias: Array) -> tuple[Array, Array]:
    """How errors go on over a window: F (fingers, 27, 27), and G (fingers, 9, 12) of the sensors' turning errors.

    With q_new = conj(T_p) q T_c and T(b + db) = T exp(J db): dth_new = R(T_c)' dth + J_c db_c - R(q_new)' J_p db_p. (2.20)-(2.22), not linearised in dt
    """
    fingers = len(q_new)
    F, G = np.tile(EYE, (fingers, 1, 1)), np.zeros((fingers, 9, 12))
    back, R_cp = np.split(quat.matrix(quat.conjugate(np.concatenate([turned[:, 1:], q_new], axis=1))), 2, axis=1)
    for j in range(3):
        rows = slice(3 * j, 3 * j + 3)
        F[:, rows, rows] = back[:, j]
        G[:, rows, rows], G[:, rows, 3 * j + 3 : 3 * j + 6] = -R_cp[:, j], np.eye(3)
    for i in range(4):
        columns = slice(3 * i, 3 * i + 3)
        F[:, ANGLES, 9 + 3 * i : 12 + 3 * i] = G[:, :, columns] @ by_bias[:, i]
    return F, G


def by_biases(turns: Array, after: Array, bias_time: Array) -> Array:
    """How the turn of each sensor over a window changes with its bias, J (F, 4, 3, 3): T(b + db) = T exp(J db)."""
    since = quat.matrix(quat.relative(after[-1], after))  # from the end of each sample to the end of the window
    return np.asarray(-(since @ (_right_jacobian(turns) * bias_time[..., None, None])).sum(axis=0))


def _right_jacobian(v: Array) -> Array:
    """exp(v + dv) = exp(v) exp(J dv), (..., 3, 3)."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    sq = x * x + y * y + z * z
    small = sq < 1e-6
    safe = np.where(small, 1.0, sq)
    angle = np.sqrt(safe)
    a = np.where(small, 0.5 - sq / 24, (1 - np.cos(angle)) / safe)
    b = np.where(small, 1 / 6 - sq / 120, (angle - np.sin(angle)) / (safe * angle))
    S = quat.skew(v)
    return np.asarray(np.eye(3) - a[..., None, None] * S + b[..., None, None] * (S @ S))


def _window(params: FilterParams, state: State, samples: Samples, first: int) -> tuple[int, bool]:
    """Up to which row the window goes on before it closes or a joint appears or goes, and whether it closes with the last of them."""
    due = int(np.searchsorted(samples.t, state.t + params.update - 1e-9))
    last = max(min(due, len(samples) - 1), first) + 1
    changes = np.flatnonzero((samples.known[first:last] != state.known).any(axis=(1, 2)))
    if len(changes):
        return first + int(changes[0]), False
    return last, last - 1 >= due


def _turned(state: State, samples: Samples, first: int, last: int) -> State:
    """Add the turns of rows first..last to the open window."""
    bias_time = samples.bias_time[first:last]
    turns = samples.turn[first:last] - state.bias * bias_time[..., None]  # (2.4)
    steps, after, turned = quat.exp(turns), np.empty((last - first, *state.turned.shape)), state.turned
    by = _from_right(steps)
    for k in range(last - first):
        after[k] = turned = (by[k] @ turned[..., None])[..., 0]
    return replace(
        state,
        newest=float(samples.t[last - 1]),
        turned=turned,
        turns=np.concatenate([state.turns, turns]),
        after=np.concatenate([state.after, after]),
        bias_time=np.concatenate([state.bias_time, bias_time]),
        doubt=np.concatenate([state.doubt, samples.doubt[first:last]]),
    )


def _from_right(q: Array) -> Array:
    """Matrices M (..., 4, 4) with multiply(p, q) = M p: one product a sample costs a quarter of quat.multiply's time."""
    w, x, y, z = (q[..., k] for k in range(4))
    M = np.empty((*q.shape, 4))
    for row, values in enumerate(((w, -x, -y, -z), (x, w, z, -y), (y, -z, w, x), (z, y, -x, w))):
        for column, value in enumerate(values):
            M[..., row, column] = value
    return M


def _predicted(params: FilterParams, state: State) -> State:
    """The window's end becomes the state; the covariance goes along. (2.16)"""
    span = _span(state)
    q_new = carried(state.q_pc, state.turned)
    F, G = transition(q_new, state.turned, by_biases(state.turns, state.after, state.bias_time))
    size = quat.angle(state.turned)
    alike = max(1.0, params.correlation / span) if span > 0 else 0.0
    density = np.radians(params.gyr_noise) ** 2 / 2
    noise = density * span + (params.gyr_scale * size) ** 2 * alike + state.doubt.sum(axis=0)  # (F, 4) rad^2, the same about every axis
    P = F @ state.P @ F.transpose(0, 2, 1)
    P[:, ANGLES, ANGLES] += (G * np.repeat(noise, 3, axis=1)[:, None]) @ G.transpose(0, 2, 1)
    P[:, range(9, 21), range(9, 21)] += params.bias_walk**2 * span
    return replace(state, q_pc=q_new, P=0.5 * (P + P.transpose(0, 2, 1)))


def _updated(params: FilterParams, state: State, samples: Samples, row: int) -> State:
    """What sensors and joints tell at the window's last sample; a new window opens. (2.15)"""
    span, rates = _span(state), quat.angle(state.turned)
    state = _predicted(params, state)
    if span > 0:
        acc = samples.acc[row]
        told = np.isfinite(acc).all(axis=-1)
        usable = state.known & told[:, :3] & told[:, 1:]
        R_pc = quat.matrix(state.q_pc)
        vectors = ekf_updates.vectors(params, R_pc, np.where(told[..., None], acc, 0.0), rates / span, usable)
        dimensions = ekf_updates.dimensions(params, R_pc, state.forbids, state.known)
        state = corrected(state, ekf_updates.stacked([vectors, dimensions]), max(1.0, params.correlation / span))
    return _window_open(state)


def _span(state: State) -> float:
    """Seconds since the newest update, 0 before the first."""
    return state.newest - state.t if np.isfinite(state.t) else 0.0


def corrected(state: State, rows: ekf_updates.Rows, alike: float) -> State:
    """Kalman update in Joseph's form, the rotations' errors put into the rotations; variances count `alike` times.

    The joints' play is considered, not estimated (Schmidt; Jazwinski 1970, 8.4): a constant turn is never averaged away.
    """
    R, H = rows.variance * alike, np.zeros((*rows.missed.shape, 27))
    H[..., ANGLES], H[..., PLAY] = rows.H, rows.H_play
    PH = state.P @ H.transpose(0, 2, 1)  # (F, 27, M)
    S = H @ PH
    S[:, range(S.shape[1]), range(S.shape[1])] += R
    K = np.linalg.solve(S, PH.transpose(0, 2, 1)).transpose(0, 2, 1)
    K[:, PLAY] = 0.0
    change = (K @ rows.missed[..., None])[..., 0]
    left = EYE - K @ H
    P = left @ state.P @ left.transpose(0, 2, 1) + (K * R[:, None]) @ K.transpose(0, 2, 1)
    dth = change[:, ANGLES].reshape(-1, 3, 3)
    P = _reset(P, dth)
    q_pc = quat.normalize(quat.multiply(state.q_pc, quat.exp(dth)))
    return replace(state, q_pc=q_pc, bias=state.bias + change[:, BIASES].reshape(-1, 4, 3), P=0.5 * (P + P.transpose(0, 2, 1)))


def _reset(P: Array, dth: Array) -> Array:
    """Covariance of the errors that are left once dth (F, 3, 3) is in the rotations. Source: Sola 2017, (287)"""
    J = np.tile(EYE, (len(P), 1, 1))
    for j in range(3):
        J[:, 3 * j : 3 * j + 3, 3 * j : 3 * j + 3] -= quat.skew(0.5 * dth[:, j])
    return np.asarray(J @ P @ J.transpose(0, 2, 1))


def _started(params: FilterParams, state: State, samples: Samples, row: int) -> State:
    """Joints that were not known before begin where the samples put them, as unsure as the doubt says; the open window is settled first."""
    if len(state.turns):
        state = _window_open(_predicted(params, state))
    fresh = samples.known[row] & ~state.known
    q_pc, P = np.where(fresh[..., None], samples.q_first[row], state.q_pc), state.P.copy()
    for f, j in zip(*np.nonzero(fresh)):
        own = slice(3 * j, 3 * j + 3)
        P[f, own], P[f, :, own] = 0.0, 0.0
        P[f, own, own] = np.radians(params.angle_sd) ** 2 * np.eye(3)
    return replace(state, q_pc=q_pc, P=P, known=samples.known[row].copy())


def _window_open(state: State) -> State:
    turns, after, bias_time, doubt = _nothing(len(state.q_pc))
    still = np.tile(quat.IDENTITY, (len(state.q_pc), 4, 1))
    return replace(state, t=state.newest, turned=still, turns=turns, after=after, bias_time=bias_time, doubt=doubt)


def _nothing(fingers: int) -> tuple[Array, Array, Array, Array]:
    return np.empty((0, fingers, 4, 3)), np.empty((0, fingers, 4, 4)), np.empty((0, fingers, 4)), np.empty((0, fingers, 4))
