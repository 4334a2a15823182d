"""Joint rotations of the fingers, the biases of their gyroscopes and how the sensors sit: an error-state filter a chain, all chains one batch.

In      what the four sensors of a chain (for a finger hand, proximal, middle, distal; for the wrist forearm and hand) turned by since the sample before,
        and which way is up, both in sensor frames that the calibration has turned to the segments'
Out     rotations of the true joints at every sample, with the covariance of their errors: q_true = q exp(d)
Source  Kortier, thesis ch. 2: state (2.3), (2.5); errors (2.15)-(2.22); his q^{ij} is our q_pc with i = p, j = c. Between updates the turns of the
        sensors are summed up with their change by the biases, as in Forster et al. 2017 (IEEE Trans Robot 33:1), exactly for piecewise constant rates.
        Ours: seats (sensor against segment) and skin (how far a seat turns as its joint bends) are estimated, where the thesis trusts a calibration
Limits  noise that is correlated in time is taken as white noise that is larger; the chains each know the hand's sensor for themselves
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import ekf_seats, ekf_updates
from estimators import quaternions as quat
from estimators.ekf_seats import ANGLES, BIASES, SEATS, SIZE, SKIN, Seated, SeatParams
from estimators.ekf_updates import IS_FREE, LIMITS, UpdateParams
from estimators.options import option
from estimators.quaternions import Array

Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class FilterParams(UpdateParams, SeatParams):
    update: float = option(
        0.2, "s", "time between two updates; the gyroscopes count at every sample", "ours: what they correct is slower", least=0.01
    )
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet; Kortier's Table 2.1 has 5e-4 rad/s at 200 Hz, a tenth of it",
        least=1e-6,
    )
    gyr_scale: float = option(0.003, "1", "scale error of a gyroscope axis", "ours: left after a calibration on a turntable")
    bias_walk: float = option(
        0.001, "deg/s/sqrt(s)", "random walk of a gyroscope's bias", "ours: consumer MEMS, 10 deg/h; Kortier's Table 2.1 has 1e-4 rad/s"
    )
    bias_sd: float = option(
        0.02,
        "deg/s",
        "least that the pose leaves of a gyroscope's bias; a hand that swayed in the pose leaves more, as its samples tell",
        "ours: 0.06 deg of turning unseen in a pose of 3 s",
        least=1e-6,
    )


@dataclass(frozen=True)
class Samples:
    """Aligned samples of F chains."""

    t: Array  # (n,) s
    turn: Array  # (n, F, 4, 3) rad, rotation since the sample before as a vector in the sensor's frame; 0 where nothing is known
    bias_time: Array  # (n, F, 4) s of the gyroscope's bias that is in `turn`
    acc: Array  # (n, F, 4, 3) m/s^2, specific force, or gravity as the sensor's own fusion sees it; NaN where it must not be used
    doubt: Array  # (n, F, 4) rad^2, variance of what `turn` may have missed
    known: Bools  # (n, F, 3) both segments of the joint are measured
    q_first: Array  # (n, F, 3, 4) q_pc to start a joint from that was not known before

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    q_pc: Array  # (F, 3, 4) between the frames of two sensors, at the newest update
    bias: Array  # (F, 4, 3) rad/s
    seat: Array  # (F, 4, 4) takes vectors from the segment to its sensor's frame while the joint is straight
    skin: Array  # (F, 3, 3) rad per rad of the joint's flexion that the child's sensor turns by on its segment
    P: Array  # (F, 42, 42) covariance of the errors [dth_1..3, db_1..4, dm_1..4, dk_1..3] of the four above, q_true = q exp(dth), m and k alike
    known: Bools  # (F, 3) the joint has a rotation
    free: Bools  # (F, 3, 3) the joint has flexion, deviation, pronation
    limits: Array  # (F, 3, 3, 2) rad
    aligned: bool  # the pose has turned the sensors' frames until gravity agrees
    t: float  # s, newest update; -inf before the first sample
    newest: float  # s, newest sample
    turned: Array  # (F, 4, 4) what the sensors have turned by since
    turns: Array  # (m, F, 4, 3) rad, of the samples since, biases removed
    after: Array  # (m, F, 4, 4) `turned` after each of them
    bias_time: Array  # (m, F, 4) s
    doubt: Array  # (m, F, 4) rad^2
    rest: Array  # (F, 4) s, how long each sensor has hardly turned
    crept: Array  # (F, 4, 3) rad that it has seemed to turn by in that time
    up: Array  # (F, 4, 3) the vertical over a long time, zero where not known


@dataclass(frozen=True)
class Estimate:
    q_joint: Array  # (n, F, 3, 4) rotations of the true joints
    told: NDArray[np.intp]  # (u,) rows from which on a covariance holds
    P: Array  # (u, F, 9, 9) rad^2, of the three joints' errors


def start(params: FilterParams, bias_sd: Array, aligned: bool = True, free: Bools = IS_FREE, limits: Array = LIMITS) -> State:
    """Nothing known but the size of the biases, bias_sd (F, 4) rad/s, and whether the pose has `aligned` the sensors with what it asks for; the first
    sample with a joint's two segments starts it."""
    chains = len(free)
    P = np.zeros((chains, SIZE, SIZE))
    P[:, range(9, 21), range(9, 21)] = np.repeat(bias_sd**2, 3, axis=1)
    q_pc, still = np.tile(quat.IDENTITY, (chains, 3, 1)), np.tile(quat.IDENTITY, (chains, 4, 1))
    known, nothing = np.zeros((chains, 3), bool), np.zeros((chains, 4, 3))
    ended = (-np.inf, -np.inf, still, *_nothing(chains))
    return State(
        q_pc, nothing, still, np.zeros((chains, 3, 3)), P, known, free, limits, aligned, *ended, np.zeros((chains, 4)), nothing, nothing
    )


def step(params: FilterParams, state: State, samples: Samples) -> tuple[State, Estimate]:
    """Advance by samples of any number, 0 included: nothing depends on where they are cut."""
    n, chains = len(samples), len(state.q_pc)
    after, base, told, P = np.empty((n, chains, 4, 4)), np.empty(n, np.intp), [], []
    states, first = [state], 0
    while first < n:
        if not np.array_equal(state.known, samples.known[first]):
            state = _started(params, state, samples, first)
            states.append(state)
            told.append(first)
            P.append(_of_joints(state, ekf_seats.seated(state.q_pc, state.seat, state.skin)))
        last, closes = _window(params, state, samples, first)
        state = _turned(state, samples, first, last)
        after[first:last], base[first:last] = state.after[len(state.after) - (last - first) :], len(states) - 1
        if closes:
            state, seated = _updated(params, state, samples, last - 1)
            states.append(state)
            told.append(last - 1)
            P.append(_of_joints(state, seated))
            after[last - 1], base[last - 1] = state.turned, len(states) - 1
        first = last
    q_pc, seat, skin = (np.array([getattr(s, name) for s in states])[base] for name in ("q_pc", "seat", "skin"))
    q_joint = ekf_seats.joints(q_pc, seat, skin, after)
    return state, Estimate(q_joint, np.array(told, np.intp), np.array(P).reshape(-1, chains, 9, 9))


def transition(q_new: Array, turned: Array, by_bias: Array) -> tuple[Array, Array]:
    """How the joints' errors go on over a window: F (chains, 9, 21) by those before and the biases', G (chains, 9, 12) by the sensors' turning errors.

    With q_new = conj(T_p) q T_c and T(b + db) = T exp(J db): dth_new = R(T_c)' dth + J_c db_c - R(q_new)' J_p db_p. (2.20)-(2.22), not linearised in dt
    """
    chains = len(q_new)
    F, G = np.zeros((chains, 9, 21)), np.zeros((chains, 9, 12))
    back, R_cp = np.split(quat.matrix(quat.conjugate(np.concatenate([turned[:, 1:], q_new], axis=1))), 2, axis=1)
    for j in range(3):
        rows = slice(3 * j, 3 * j + 3)
        F[:, rows, rows] = back[:, j]
        G[:, rows, rows], G[:, rows, 3 * j + 3 : 3 * j + 6] = -R_cp[:, j], np.eye(3)
        F[:, rows, 9 + 3 * j : 12 + 3 * j] = -R_cp[:, j] @ by_bias[:, j]
        F[:, rows, 12 + 3 * j : 15 + 3 * j] = by_bias[:, j + 1]
    return F, G


def by_biases(turns: Array, after: Array, bias_time: Array) -> Array:
    """How the turn of each sensor over a window changes with its bias, J (F, 4, 3, 3): T(b + db) = T exp(J db)."""
    since = quat.matrix(quat.relative(after[-1], after))  # from the end of each sample to the end of the window
    return np.asarray(-(since @ (ekf_seats.right_jacobian(turns) * bias_time[..., None, None])).sum(axis=0))


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
    q_new = ekf_seats.carried(state.q_pc, state.turned)
    F, G = transition(q_new, state.turned, by_biases(state.turns, state.after, state.bias_time))
    size = quat.angle(state.turned)
    density = np.radians(params.gyr_noise) ** 2 / 2
    noise = density * span + (params.gyr_scale * size) ** 2 + state.doubt.sum(axis=0)  # (F, 4) rad^2, the same about every axis
    P = state.P.copy()
    across = F @ P[:, :21]  # only the rows of the joints change
    of_angles = across[:, :, :21] @ F.transpose(0, 2, 1) + (G * np.repeat(noise, 3, axis=1)[:, None]) @ G.transpose(0, 2, 1)
    P[:, ANGLES], P[:, :, ANGLES] = across, across.transpose(0, 2, 1)
    P[:, ANGLES, ANGLES] = 0.5 * (of_angles + of_angles.transpose(0, 2, 1))
    P[:, range(9, 21), range(9, 21)] += np.radians(params.bias_walk) ** 2 * span
    return replace(state, q_pc=q_new, P=P)


def _updated(params: FilterParams, state: State, samples: Samples, row: int) -> tuple[State, Seated]:
    """What sensors and joints tell at the window's last sample, and the joints as they were seen; a new window opens. (2.15)"""
    span, turned, measured = _span(state), state.turned, state.bias_time.sum(axis=0) > 0
    state = _predicted(params, state)
    seated = ekf_seats.seated(state.q_pc, state.seat, state.skin)
    if span > 0:
        acc = samples.acc[row]
        told = np.isfinite(acc).all(axis=-1)
        usable = state.known & told[:, :3] & told[:, 1:]
        acc, rates = np.where(told[..., None], acc, 0.0), quat.angle(turned) / span
        state = replace(state, up=ekf_updates.settled(state.up, turned, acc, told, span))
        vectors = ekf_updates.vectors(params, quat.matrix(state.q_pc), acc, state.up, rates, usable, span)
        joints = ekf_updates.joints(params, seated, _of_joints(state, seated), state.free, state.limits, state.known, span)
        state = corrected(state, ekf_updates.stacked([vectors, joints]))
        state = _rested(params, state, turned, span, measured)
    return _window_open(state), seated


def _rested(params: FilterParams, state: State, turned: Array, span: float, measured: Bools) -> State:
    """Sensors that hardly turn show their bias: its mean over every REST seconds is a measurement, their creeping its noise."""
    crept = quat.log(turned)
    still = measured & (quat.angle(turned) < np.radians(params.rest_rate) * span)
    rest = np.where(still, state.rest + span, 0.0)
    creeping = np.where(still[..., None], state.crept + crept, 0.0)
    due = rest >= ekf_updates.REST - 1e-9
    if due.any():
        state = _where(np.asarray(due.any(axis=1)), corrected(state, ekf_updates.resting(params, creeping, rest, due)), state)
        rest, creeping = np.where(due, 0.0, rest), np.where(due[..., None], 0.0, creeping)
    return replace(state, rest=rest, crept=creeping)


def _where(chosen: Bools, a: State, b: State) -> State:
    """What the filter knows of each chain from a where `chosen` (F,), else from b to the last bit."""
    names = ("q_pc", "bias", "seat", "skin", "P")
    both = ((n, getattr(a, n), getattr(b, n)) for n in names)
    return replace(b, **{n: np.where(chosen.reshape(-1, *[1] * (x.ndim - 1)), x, y) for n, x, y in both})


def _span(state: State) -> float:
    """Seconds since the newest update, 0 before the first."""
    return state.newest - state.t if np.isfinite(state.t) else 0.0


def corrected(state: State, rows: ekf_updates.Rows) -> State:
    """Kalman update; the errors found are put into the rotations, whose covariance changes by that only in the second order."""
    PH = state.P @ rows.H.transpose(0, 2, 1)  # (F, 42, M)
    KT = np.linalg.solve(rows.H @ PH + rows.noise, PH.transpose(0, 2, 1))
    change = (KT.transpose(0, 2, 1) @ rows.missed[..., None])[..., 0]
    P = state.P - PH @ KT
    return replace(
        state,
        q_pc=_turned_by(state.q_pc, change[:, ANGLES]),
        bias=state.bias + change[:, BIASES].reshape(-1, 4, 3),
        seat=_turned_by(state.seat, change[:, SEATS]),
        skin=state.skin + change[:, SKIN].reshape(-1, 3, 3),
        P=0.5 * (P + P.transpose(0, 2, 1)),
    )


def _turned_by(q: Array, dth: Array) -> Array:
    return quat.normalize(quat.multiply(q, quat.exp(dth.reshape(*q.shape[:-1], 3))))


def _of_joints(state: State, seated: Seated) -> Array:
    """Covariance (F, 9, 9) of the true joints' errors."""
    return np.asarray(seated.A @ state.P @ seated.A.transpose(0, 2, 1))


def _started(params: FilterParams, state: State, samples: Samples, row: int) -> State:
    """Joints that were not known before begin where the samples put them, as sure as a pose leaves them; the open window is settled first."""
    if len(state.turns):
        state = _window_open(_predicted(params, state))
    fresh = samples.known[row] & ~state.known
    q_pc, P = np.where(fresh[..., None], samples.q_first[row], state.q_pc), state.P.copy()
    posed = ekf_seats.after_pose(params, q_pc, np.nan_to_num(samples.acc[row]), state.free, state.aligned)
    for f in np.flatnonzero(fresh.any(axis=1)):
        own = _own(fresh[f], first=bool(not state.known[f].any()))
        P[np.ix_([f], own, np.arange(SIZE))] = 0.0
        P[np.ix_([f], np.arange(SIZE), own)] = 0.0
        P[np.ix_([f], own, own)] = posed[np.ix_([f], own, own)]
    return replace(state, q_pc=q_pc, P=P, known=samples.known[row].copy())


def _own(fresh: Bools, first: bool) -> NDArray[np.intp]:
    """Error states of the joints that begin: their rotations, seats and skins; the chain's first seat with the first of them."""
    own = np.concatenate([fresh, np.zeros(4, bool), [first], fresh, fresh])
    return np.flatnonzero(np.repeat(own, 3))


def _window_open(state: State) -> State:
    turns, after, bias_time, doubt = _nothing(len(state.q_pc))
    still = np.tile(quat.IDENTITY, (len(state.q_pc), 4, 1))
    return replace(state, t=state.newest, turned=still, turns=turns, after=after, bias_time=bias_time, doubt=doubt)


def _nothing(chains: int) -> tuple[Array, Array, Array, Array]:
    return np.empty((0, chains, 4, 3)), np.empty((0, chains, 4, 4)), np.empty((0, chains, 4)), np.empty((0, chains, 4))
