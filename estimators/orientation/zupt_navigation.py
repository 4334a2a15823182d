"""Where the hand moves for a few seconds: position, velocity and orientation of its sensor by
strap-down integration, brought to rest whenever it stands still.

In      inertial (and, if wanted, magnetic) samples of the hand's sensor, a Calibration
Out     HandPath at every sample: place and velocity in the global frame (z up) since the start,
        orientation of the hand, standard deviations
Source  Kortier, thesis 2.2.4, (2.33), after Roetenberg et al. 2005; standstill: Skog et al. 2010
        (sensors/zero_velocity_detector.py). The error state is [dp, dv, dth, db_g, db_a] in the global frame: q_true
        = exp(dth) q; the accelerometer's bias is ours
Limits  between two standstills the place drifts with the square of time: a path is good for a few
        seconds, and its standard deviation says how good; the place is the sensor's on the back of
        the hand, not the wrist's; without magnetometer the heading drifts with the gyroscope's bias
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, GYR, MAG, Block
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation.fusion import make_upright
from handscope.estimators.sensors.zero_velocity_detector import likelihood_ratio

P, V, TH, BG, BA = (slice(3 * k, 3 * k + 3) for k in range(5))
UP = np.array([0.0, 0.0, GRAVITY])
DEG = np.pi / 180


@dataclass(frozen=True, kw_only=True)
class HandFilterParams:
    """Options of the hand's path."""

    gyr_reading: str = option(
        "mean",
        "",
        "what a gyroscope's sample is, as in the fusion",
        "as the fusion's",
        ("mean", "instant"),
    )
    update: float = option(
        0.05, "s", "time between two looks for a standstill", "ours", least=0.01, most=0.5
    )
    still_window: float = option(
        0.15,
        "s",
        "stretch that is looked at",
        "Skog et al. 2010: 5 to 30 samples at 100 Hz",
        least=0.05,
    )
    still_gyr: float = option(
        4.0,
        "deg/s",
        "angular rate of a hand that stands still",
        "ours: twice VQF's rest threshold",
        least=0.01,
    )
    still_acc: float = option(
        0.25,
        "m/s^2",
        "deviation from gravity of a hand that stands still",
        "ours: half of VQF's rest threshold",
        least=0.001,
    )
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet",
        least=1e-6,
    )
    acc_noise: float = option(
        0.004,
        "m/s^2/sqrt(Hz)",
        "white noise density of an accelerometer axis",
        "Kortier thesis, Table 2.1: 4e-2 m/s^2 at 100 Hz",
    )
    gyr_bias_walk: float = option(
        1e-4, "rad/s/sqrt(s)", "random walk of the gyroscope's bias", "Kortier thesis, Table 2.1"
    )
    acc_bias_sd: float = option(
        0.1,
        "m/s^2",
        "constant part of the accelerometer's error in each axis",
        "ours: scale and misalignment after calibration",
    )
    gyr_bias_sd: float = option(
        0.1,
        "deg/s",
        "what the pose leaves of the gyroscope's bias",
        "ours: 0.3 deg of turning unseen in a pose of 3 s",
        least=1e-6,
    )
    inclination_sd: float = option(
        1.0,
        "deg",
        "inclination at the start",
        "ours: 0.1 m/s^2 of accelerometer error is 0.6 deg",
        least=1e-6,
    )
    still_speed: float = option(
        0.01, "m/s", "speed of a hand that stands still", "ours: tremor", least=1e-6
    )
    north_sd: float = option(
        10.0, "deg", "error of the heading that the magnetometer tells", "ours: indoors", least=0.1
    )
    magnetometer: bool = option(
        False,
        "",
        "keep the heading by the magnetometer of the hand, where there is one",
        "Kortier thesis 2.2.4; indoors off",
    )
    max_gap: float = option(
        0.25, "s", "a longer gap forgets the velocity", "as the fusion's", most=1.0
    )


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    q_BS: Array  # (4,) sensor to hand
    north: float | None  # rad, heading of magnetic north in the pose
    q_GH: Array | None  # (4,) None before the first sample
    p: Array  # (3,) m
    v: Array  # (3,) m/s
    bias: Array  # (6,) of gyroscope and accelerometer, hand frame
    covariance: Array  # (15, 15)
    recent: Array  # (m, 6) newest samples, hand frame, as read
    waiting: Array  # (k, 6) samples since the last update
    waiting_t: Array  # (k,)
    t: float = -np.inf  # s, newest sample used
    mag: Array | None = None  # (3,) newest magnetometer sample, hand frame


@dataclass(frozen=True)
class HandPath:
    """Position (m), velocity (m/s) and orientation q_GH at every sample."""

    t: Array  # (n,) s
    p: Array  # (n, 3) m, global frame, from the first sample
    v: Array  # (n, 3) m/s
    q_GH: Array  # (n, 4)
    p_sd: Array  # (n, 3) m
    still: Bools  # (n,)

    def __len__(self) -> int:
        return len(self.t)


NOTHING = HandPath(
    np.empty(0),
    np.empty((0, 3)),
    np.empty((0, 3)),
    np.empty((0, 4)),
    np.empty((0, 3)),
    np.empty(0, bool),
)


def start(params: HandFilterParams, calibration: Calibration) -> State:
    """At rest where it is, as the pose found it; without a pose the first sample gives the
    inclination."""
    q_BS = calibration.q_BS.get("hand", quat.IDENTITY)
    q_GS, bias = calibration.q_GS.get("hand"), np.zeros(6)
    bias[:3] = quat.rotate(q_BS, calibration.gyr_bias.get("hand", np.zeros(3)))
    sd = [
        1e-6,
        params.still_speed,
        params.inclination_sd * DEG,
        params.gyr_bias_sd * DEG,
        params.acc_bias_sd,
    ]
    q_GH = None if q_GS is None else quat.multiply(q_GS, quat.conjugate(q_BS))
    nothing = np.empty((0, 6))
    return State(
        q_BS,
        calibration.north.get("hand"),
        q_GH,
        np.zeros(3),
        np.zeros(3),
        bias,
        np.diag(np.repeat(sd, 3) ** 2),
        nothing,
        nothing,
        np.empty(0),
    )


def step(params: HandFilterParams, state: State, block: Block) -> tuple[State, HandPath]:
    """Advance by one block of any length; blocks without the hand's sensor change nothing, and
    nothing depends on where they are cut."""
    if "hand" not in block.stream.sensors or not len(block.t):
        return state, NOTHING
    k = block.stream.sensors.index("hand")
    if MAG in block.stream.quantities:
        mag = block.of(MAG)[:, k]
        mag = mag[np.isfinite(mag).all(axis=1)]
        state = replace(state, mag=quat.rotate(state.q_BS, mag[-1])) if len(mag) else state
    if not block.stream.inertial:
        return state, NOTHING
    samples = np.concatenate(
        [
            quat.rotate(state.q_BS, block.of(GYR)[:, k]),
            quat.rotate(state.q_BS, block.of(ACC)[:, k]),
        ],
        axis=1,
    )
    good = np.isfinite(samples).all(axis=1)
    state = replace(
        state,
        waiting=np.concatenate([state.waiting, samples[good]]),
        waiting_t=np.concatenate([state.waiting_t, block.t[good]]),
    )
    return _advance(params, state, whole=False)


def finish(params: HandFilterParams, state: State) -> tuple[State, HandPath]:
    """Give out what still waits for its window's end."""
    return _advance(params, state, whole=True)


def _ends(params: HandFilterParams, t: Array) -> NDArray[np.int_]:
    """Rows behind which a window ends: those that begin the next one."""
    slot = np.floor(t / params.update + 1e-9)
    return np.flatnonzero(np.diff(slot) > 0) + 1


def _advance(params: HandFilterParams, state: State, whole: bool) -> tuple[State, HandPath]:
    """Through the windows that have ended, or all that waits."""
    edges = [0, *_ends(params, state.waiting_t), *([len(state.waiting_t)] if whole else [])]
    if len(edges) == 1:
        return state, NOTHING
    pieces, samples, t = [], state.waiting, state.waiting_t
    for first, last in zip(edges[:-1], edges[1:]):
        if last > first:
            state, piece = _window(params, state, t[first:last], samples[first:last])
            pieces.append(piece)
    return replace(state, waiting=samples[edges[-1] :], waiting_t=t[edges[-1] :]), _join(
        pieces
    ) if pieces else NOTHING


def _window(
    params: HandFilterParams, state: State, t: Array, samples: Array
) -> tuple[State, HandPath]:
    """One window of samples: integrate, then correct where the hand stands still."""
    if state.q_GH is None:
        state = replace(state, q_GH=make_upright(np.array([1.0, 0, 0, 0]), samples[0, 3:]))
    fresh = not np.isfinite(state.t)
    dt = np.diff(t, prepend=t[0] if fresh else state.t)
    if dt[0] > params.max_gap:
        state, dt[0] = _reset_position(state), 0.0
    q_GH, p, v, covariance = _integrate(params, state, dt, samples)
    length = max(2, round(params.still_window / max(float(np.median(dt)), 1e-4)))
    recent = np.concatenate([state.recent, samples])[-length:]
    after = replace(
        state, q_GH=q_GH[-1], p=p[-1], v=v[-1], covariance=covariance, recent=recent, t=float(t[-1])
    )
    still = (
        len(recent) >= length
        and likelihood_ratio(
            recent[:, :3] - state.bias[:3],
            recent[:, 3:] - state.bias[3:],
            params.still_gyr * DEG,
            params.still_acc,
        )
        < 1.0
    )
    after = _zero_velocity_update(params, after) if still else after
    if params.magnetometer and after.mag is not None and after.north is not None:
        after = _heading_update(params, after)
    p[-1], v[-1], q_GH[-1] = after.p, after.v, after.q_GH
    sd = np.tile(np.sqrt(np.maximum(np.diag(after.covariance)[P], 0.0)), (len(t), 1))
    return after, HandPath(t, p, v, q_GH, sd, np.full(len(t), still))


def _integrate(
    params: HandFilterParams, state: State, dt: Array, samples: Array
) -> tuple[Array, Array, Array, Array]:
    """Orientation, place and velocity at every sample and the covariance at the last. (2.33)"""
    assert state.q_GH is not None
    rates = samples[:, :3]
    if params.gyr_reading == "instant":
        before = state.recent[-1:, :3] if len(state.recent) else rates[:1]
        rates = 0.5 * (rates + np.concatenate([before, rates[:-1]]))
    q_GH = quat.normalize(
        quat.multiply(
            state.q_GH, _cumulative_products(quat.exp((rates - state.bias[:3]) * dt[:, None]))
        )
    )
    force = quat.rotate(q_GH, samples[:, 3:] - state.bias[3:])
    v = state.v + _integral(_between(force) - UP, dt)
    p = state.p + _integral(_between(v, state.v[None]), dt)
    covariance = _propagate_covariance(params, state.covariance, dt, quat.matrix(q_GH), force)
    return q_GH, p, v, covariance


def _propagate_covariance(
    params: HandFilterParams, covariance: Array, dt: Array, R: Array, force: Array
) -> Array:
    """The covariance after samples of orientation R (n, 3, 3) and force (n, 3) in the global frame:
    derivatives summed as the values are."""
    from filterpy.common import Q_continuous_white_noise

    T, F, Q = float(dt.sum()), np.eye(15), np.zeros((15, 15))
    turned = _integral(R, dt)  # dth = -turned db_g
    # of the force by dth, db_g, db_a
    pushed = np.concatenate([-quat.skew(force), quat.skew(force) @ turned, -R], axis=2)
    faster = _integral(_between(pushed), dt)
    F[P, V], F[TH, BG] = T * np.eye(3), -turned[-1]
    F[V, 6:], F[P, 6:] = faster[-1], _integral(_between(faster, np.zeros_like(faster[:1])), dt)[-1]
    Q[:6, :6] = Q_continuous_white_noise(2, T, params.acc_noise**2, 3, order_by_dim=False)
    Q[TH, TH], Q[BG, BG] = (
        (params.gyr_noise * DEG) ** 2 * T * np.eye(3),
        params.gyr_bias_walk**2 * T * np.eye(3),
    )
    return np.asarray(F @ covariance @ F.T + Q)


def _cumulative_products(turns: Array) -> Array:
    """Products of the first 1, 2, ..., n turns (n, 4), by doubling."""
    q, reach = turns.copy(), 1
    while reach < len(q):
        q[reach:] = quat.multiply(q[:-reach], q[reach:])
        reach *= 2
    return q


def _between(values: Array, first: Array | None = None) -> Array:
    """Means of each value and the one before; before the first there is `first` or nothing else
    than itself."""
    return np.asarray(
        0.5 * (values + np.concatenate([values[:1] if first is None else first, values[:-1]]))
    )


def _integral(values: Array, dt: Array) -> Array:
    """Running integral (n, ...)."""
    return np.asarray(np.cumsum(values * dt.reshape(-1, *(1,) * (values.ndim - 1)), axis=0))


def _zero_velocity_update(params: HandFilterParams, state: State) -> State:
    """Velocity and angular rate are zero, the accelerometer reads gravity."""
    assert state.q_GH is not None
    R = quat.matrix(state.q_GH)
    force = R @ (state.recent[:, 3:].mean(axis=0) - state.bias[3:])
    H, r = (
        np.zeros((9, 15)),
        np.concatenate([-state.v, state.recent[:, :3].mean(axis=0) - state.bias[:3], UP - force]),
    )
    H[0:3, V], H[3:6, BG], H[6:9, TH], H[6:9, BA] = np.eye(3), np.eye(3), -quat.skew(force), -R
    # windows overlap: each update uses the part of the window that is new
    share = np.sqrt(params.still_window / params.update)
    sd = np.repeat(
        [params.still_speed, 0.25 * params.still_gyr * DEG * share, params.still_acc * share], 3
    )
    return _correct(state, H, r, sd)


def _heading_update(params: HandFilterParams, state: State) -> State:
    """The horizontal field points to where it pointed in the pose."""
    assert state.q_GH is not None and state.mag is not None and state.north is not None
    x, y, _ = quat.rotate(state.q_GH, state.mag)
    # turned clockwise, seen from above
    off = quat.wrapped(np.arctan2(x, y) - state.north)
    H = np.zeros((1, 15))
    H[0, 8] = 1.0
    return _correct(
        state, H, np.array([off]), np.array([params.north_sd * DEG / np.sqrt(params.update)])
    )


def _correct(state: State, H: Array, r: Array, sd: Array) -> State:
    """One Kalman update with measurement residuals r and noise sd; the covariance in Joseph's
    form."""
    from filterpy.kalman import update  # here: it imports scipy.stats, 0.3 s

    assert state.q_GH is not None
    dx, covariance = update(np.zeros(15), state.covariance, r, np.diag(sd**2), H)
    return replace(
        state,
        p=state.p + dx[P],
        v=state.v + dx[V],
        q_GH=quat.normalize(quat.multiply(quat.exp(dx[TH]), state.q_GH)),
        bias=state.bias + dx[9:],
        covariance=covariance,
    )


def _reset_position(state: State) -> State:
    """After a gap: where it is and how fast is not known, it counts as at rest until it is seen."""
    C = state.covariance.copy()
    C[:6] = C[:, :6] = 0.0
    C[range(6), range(6)] = [0.25] * 3 + [0.25] * 3  # m, m/s: a hand's reach
    C[TH, TH] += np.eye(3) * (30 * DEG) ** 2
    return replace(state, v=np.zeros(3), covariance=C, recent=state.recent[:0])


def _join(pieces: list[HandPath]) -> HandPath:
    return HandPath(
        *(np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(HandPath))
    )
