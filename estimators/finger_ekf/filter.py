"""Joint rotations of the fingers, the biases of their gyroscopes and how the sensors sit: an error-state filter a chain, all chains one batch.

In      what the four sensors of a chain (for a finger hand, proximal, middle, distal; for the wrist forearm and hand) turned by since the sample before,
        and which way is up, both in sensor frames that the calibration has turned to the segments'
Out     rotations of the true joints at every sample, with the covariance of their errors: q_true = q exp(d)
Source  Kortier, thesis ch. 2: state (2.3), (2.5); errors (2.15)-(2.22); his q^{ij} is our q_pc with i = p, j = c. Between updates the turns of the
        sensors are summed up with their change by the biases, as in Forster et al. 2017 (IEEE Trans Robot 33:1), exactly for piecewise constant rates.
        Ours: seats (sensor against segment) and skin (how far a seat turns as its joint bends) are estimated, where the thesis trusts a calibration
Limits  noise that is correlated in time is taken as white noise that is larger; the chains each know the hand's sensor for themselves
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.finger_ekf import (
    inclination_noise,
    joint_compliance,
    magnetic_heading,
    preintegration,
    sensor_to_segment,
    zero_rate_update,
)
from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf.magnetic_heading import MagnetometerParams
from handscope.estimators.finger_ekf.measurements import IS_FREE, LIMITS, RATE_GATE, UpdateParams
from handscope.estimators.finger_ekf.preintegration import MAG_ERROR
from handscope.estimators.finger_ekf.sensor_to_segment import (
    APART,
    SIZE,
    SeatParams,
    Seats,
    put_right,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.small_matrices import put, spread
from handscope.estimators.numerics.typing import Array, Bools, Indices

UPDATED = (  # fields of a state that an update changes, in the order of its kernel
    *("q_pc", "bias", "seat", "skin", "apart", "P", "up", "rest", "crept"),
    *("rested", "creep", "lively", "began", "lies", "give"),
)
MUCH = math.radians(0.5) ** 2  # rad^2 that a sensor may have missed since the update


@dataclass(frozen=True, kw_only=True)
class FilterParams(UpdateParams, SeatParams, MagnetometerParams):
    update: float = option(
        0.2,
        "s",
        "time between two updates; the gyroscopes count at every sample",
        "ours: what they correct is slower",
        least=0.01,
    )
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet; Kortier's Table 2.1 has 5e-4 rad/s at 200 Hz, a tenth of it",
        least=1e-6,
    )
    gyr_scale: float = option(
        0.003,
        "1",
        "scale error of a gyroscope axis",
        "ours: left after a calibration on a turntable",
    )
    bias_walk: float = option(
        0.001,
        "deg/s/sqrt(s)",
        "random walk of a gyroscope's bias",
        "ours: consumer MEMS, 10 deg/h; Kortier's Table 2.1 has 1e-4 rad/s",
    )
    bias_sd: float = option(
        0.01,
        "deg/s",
        "what the pose leaves of a gyroscope's bias beside what its samples' scatter tells: turning that is the same all the time",
        "0.009 fits 16 sensors on a person who stands still best (qmt's full-body example): docs/decisions/0009-sizes-of-errors.md",
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
    mag: Array | None = (
        None  # (n, F, 2, 3) uT, fields at the chain's first and last sensor, NaN where not known; None: not asked for
    )

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    q_pc: Array  # (F, 3, 4) between the frames of two sensors, at the newest update
    bias: Array  # (F, 4, 3) rad/s
    seat: Array  # (F, 4, 4) takes vectors from the segment to its sensor's frame while the joint is straight
    skin: Array  # (F, 3, 3) rad per rad of the joint's flexion that the child's sensor turns by on its segment
    apart: Array  # (F, 2) uT by which the field at the chain's end differs from that at its beginning, across it; how often that was unlikely
    P: Array  # (F, 43, 43) covariance of the errors [dth_1..3, db_1..4, dm_1..4, dk_1..3, da] of the five above, q_true = q exp(dth), m alike
    known: Bools  # (F, 3) the joint has a rotation
    free: Bools  # (F, 3, 3) the joint has flexion, deviation, pronation
    limits: Array  # (F, 3, 3, 2) rad
    seats: Seats  # before they moved
    t: float  # s, newest update; -inf before the first sample
    newest: float  # s, newest sample
    turned: Array  # (F, 4, 4) what the sensors have turned by since the update
    by_bias: Array  # (F, 4, 3, 3) how that changes with their biases: T(b + db) = T exp(J db)
    bias_time: Array  # (F, 4) s of the biases that is in it
    doubt: Array  # (F, 4) rad^2, variance of what it may have missed
    rest: Array  # (F, 4) s, how long each sensor has hardly turned
    crept: Array  # (F, 4, 3) rad that it has seemed to turn by in that time, its bias included
    rested: Array  # (F, 4, 3) rad/s, so at the rest before; NaN before the first
    creep: (
        Array  # (F, 2) half the squared differences between such rates, (rad/s)^2, and their number
    )
    up: Array  # (F, 4, 3) the vertical over a long time, zero where not known
    lively: Array  # (F, 4) (rad/s)^2, rates squared over the time that errors of the vertical last
    began: Array  # (F, 4, 3) the vertical at first, zero where not known
    lies: Array  # (F, 4, 3) the vertical over the time that its errors last
    give: Array  # (F, 3, 2) what the joints have seemed to give, rad^2, weighted, and the sum of the weights


@dataclass(frozen=True)
class Estimate:
    q_joint: Array  # (n, F, 3, 4) rotations of the true joints
    told: Indices  # (u,) rows from which on a covariance holds
    P: Array  # (u, F, 9, 9) rad^2, of the three joints' errors


def start(
    bias_sd: Array,
    seats: Seats,
    free: Bools = IS_FREE,
    limits: Array = LIMITS,
    apart_sd: float = 0.0,
) -> State:
    """Nothing known but the size of the biases, bias_sd (F, 4) rad/s, how sensors may sit and by what (uT) fields may differ; the first sample with a
    joint's two segments starts it."""
    chains = len(free)
    P = np.zeros((chains, SIZE, SIZE))
    P[:, range(9, 21), range(9, 21)] = np.repeat(bias_sd**2, 3, axis=1)
    P[:, APART, APART] = apart_sd**2
    q_pc, still = np.tile(quat.IDENTITY, (chains, 3, 1)), _still(chains)
    known, nothing = np.zeros((chains, 3), bool), np.zeros((chains, 4, 3))
    ended = (-np.inf, -np.inf, still, *_nothing(chains))
    return State(
        q_pc,
        nothing,
        still,
        np.zeros((chains, 3, 3)),
        np.zeros((chains, 2)),
        P,
        known,
        free,
        limits,
        seats,
        *ended,
        np.zeros((chains, 4)),
        nothing,
        np.full((chains, 4, 3), np.nan),
        np.zeros((chains, 2)),
        nothing,
        np.zeros((chains, 4)),
        nothing,
        nothing,
        np.zeros((chains, 3, 2)),
    )


def step(params: FilterParams, state: State, samples: Samples) -> tuple[State, Estimate]:
    """Advance by samples of any number, 0 included: nothing depends on where they are cut."""
    numbers, told, P, first = _numbers(params), [], [], 0
    q_joint, known = np.empty((len(samples), *state.q_pc.shape)), samples.known.astype(float)
    while first < len(samples):
        last, closes = _window(
            state.t + params.update - 1e-9,
            first,
            samples.t,
            samples.doubt,
            state.doubt,
            known,
            state.known,
        )
        if last == first:
            state = _started(params, numbers, state, samples, first)
            told.append(first)
            P.append(_covariance(state.q_pc, state.seat, state.skin, state.P, np.zeros(9)))
            continue
        state, q_joint[first : int(last)] = _turned(state, samples, first, int(last))
        first = int(last)
        if closes:
            mag = (
                np.full((len(state.q_pc), 2, 3), np.nan)
                if samples.mag is None
                else samples.mag[first - 1]
            )
            state, q_joint[first - 1], of_joints = _told(
                numbers, state, samples.acc[first - 1], mag
            )
            told.append(first - 1)
            P.append(of_joints)
    return state, Estimate(
        q_joint, np.array(told, np.intp), np.array(P).reshape(-1, len(state.q_pc), 9, 9)
    )


@rowwise("(),(),(n),(n,f,s),(f,s),(n,f,j),(f,j)->(),()")
def _window(
    due: float,
    first: float,
    t: Array,
    doubt: Array,
    doubt_before: Array,
    known: Array,
    known_now: Array,
    last: Array,
    closes: Array,
) -> None:
    """From row `first` up to which row the window goes on before it closes or a joint appears or goes, and whether it closes with the last of them.

    It closes at once where much may have been missed: the covariance must not tell for the rest of the window what was known before.
    """
    missed = doubt_before.copy()
    last[0], closes[0] = t.shape[0], 0.0
    for k in range(int(first), t.shape[0]):
        alike, ends = True, t[k] >= due
        for f in range(missed.shape[0]):
            for j in range(known_now.shape[1]):
                alike = alike and known[k, f, j] == known_now[f, j]
            for s in range(missed.shape[1]):
                missed[f, s] += doubt[k, f, s]
                ends = ends or missed[f, s] > MUCH
        if ends or not alike:
            last[0], closes[0] = (k + 1, 1.0) if alike else (k, 0.0)
            break


def _turned(state: State, samples: Samples, first: int, last: int) -> tuple[State, Array]:
    """Add the turns of rows first..last to the open window; the true joints after each of them (rows, F, 3, 4)."""
    turn, bias_time, doubt = (
        x[first:last].swapaxes(0, 1) for x in (samples.turn, samples.bias_time, samples.doubt)
    )
    window = state.turned, state.by_bias, state.bias_time, state.doubt
    q_joint, *grown = _gone_on(
        turn, bias_time, doubt, state.bias, *window, state.q_pc, state.seat, state.skin
    )
    ended = dict(zip(("turned", "by_bias", "bias_time", "doubt"), grown))
    return replace(state, newest=float(samples.t[last - 1]), **ended), q_joint.swapaxes(0, 1)


def _told(numbers: Array, state: State, acc: Array, mag: Array) -> tuple[State, Array, Array]:
    """The window's end becomes the state, a new window opens; what sensors and joints tell at that end (2.15); the true joints (F, 3, 4) now, the
    covariance (F, 9, 9) of their errors as the joints were seen before."""
    window = _span(state), state.turned, state.by_bias, state.bias_time, state.doubt, acc, mag
    *found, q_joint, of_joints = _updated(
        numbers,
        *window,
        state.known,
        state.free,
        state.limits,
        *(getattr(state, name) for name in UPDATED),
        np.zeros(9),
    )
    return replace(state, **_opened(state), **dict(zip(UPDATED, found))), q_joint, of_joints


@rowwise(
    "(n,s,v),(n,s),(n,s),(s,v),(s,q),(s,v,v),(s),(s),(j,q),(s,q),(j,v)->(n,j,q),(s,q),(s,v,v),(s),(s)"
)
def _gone_on(
    turn: Array, time: Array, missed: Array, bias: Array, turned: Array, by_bias: Array, bias_time: Array, doubt: Array,
    q_pc: Array, seat: Array, skin: Array,
    q_joint: Array, T: Array, J: Array, timed: Array, doubted: Array,
) -> None:  # fmt: skip
    """The window goes on over all rows; where the joints are after each of them."""
    after, q, m, k = np.empty((turn.shape[0], 4, 4)), q_pc.copy(), seat.copy(), skin.copy()
    preintegration.wound_row(
        turn, time, missed, bias, turned, by_bias, bias_time, doubt, after, J, timed, doubted
    )
    for row in range(turn.shape[0]):
        sensor_to_segment.joints_row(q, m, k, after[row], q_joint[row])
        put(after[row], T)


@inlined
def _headed(
    p: Array, mag: Array, up: Array, rates: Array, known: Array, told: Array,
    q: Array, bias: Array, seat: Array, skin: Array, apart: Array, P: Array,
) -> None:  # fmt: skip
    """Magnetometers of hand and tip, where they are asked for, both sensors have all their samples and neither turns fast."""
    seen = (
        known[0] > 0
        and known[1] > 0
        and known[2] > 0
        and math.isfinite(mag[0, 0] + mag[0, 1] + mag[0, 2] + mag[1, 0] + mag[1, 1] + mag[1, 2])
    )
    if (
        p[MAG_ERROR] > 0
        and seen
        and told[0] > 0
        and told[3] > 0
        and max(rates[0], rates[3]) < p[RATE_GATE]
    ):
        missed, H, noise, change = (
            np.zeros(1),
            np.zeros((1, SIZE)),
            np.zeros((1, 1)),
            np.empty(SIZE),
        )
        if magnetic_heading.heading_row(p, q, mag.copy(), up, apart, P, missed, H, noise):
            correct(P, missed, H, noise, change)
            put_right(q, bias, seat, skin, apart, change)


@rowwise(
    "(p),(),(s,q),(s,v,v),(s),(s),(s,v),(m,v),(j),(j,v),(j,v,w),(j,q),(s,v),(s,q),(j,v),(o),(e,e),(s,v),(s),(s,v),(s,v),(o),(s),(s,v),(s,v),(j,o),(d)"
    "->(j,q),(s,v),(s,q),(j,v),(o),(e,e),(s,v),(s),(s,v),(s,v),(o),(s),(s,v),(s,v),(j,o),(j,q),(d,d)"
)
def _updated(
    p: Array, span: float, turned: Array, by_bias: Array, bias_time: Array, doubt: Array, acc: Array, mag: Array,
    known: Array, free: Array, limits: Array,
    q_pc: Array, bias: Array, seat: Array, skin: Array, apart: Array, P: Array, up: Array, rest: Array, crept: Array,
    rested: Array, creep: Array, lively: Array, began: Array, lain: Array, given: Array, row: Array,
    q_pc_new: Array, bias_new: Array, seat_new: Array, skin_new: Array, apart_new: Array, P_new: Array, up_new: Array, rest_new: Array,
    crept_new: Array, rested_new: Array, creep_new: Array, lively_new: Array, began_new: Array, lies_new: Array, give_new: Array, q_true: Array, of_joints: Array,
) -> None:  # fmt: skip
    """A window's end: the vertical as neighbours see it and what joints cannot do, then the biases of sensors at rest."""
    q, C, T, left = np.empty((3, 4)), np.empty(P.shape), turned.copy(), np.empty(1)
    b, m, k, o, resting, creeping = (
        bias.copy(),
        seat.copy(),
        skin.copy(),
        apart.copy(),
        rest.copy(),
        crept.copy(),
    )
    shown, differed, fast, first, lies, give = (
        rested.copy(),
        creep.copy(),
        lively.copy(),
        began.copy(),
        lain.copy(),
        given.copy(),
    )
    preintegration.alike_row(p, T, left)
    o[0] *= left[0]
    preintegration.window_row(p, span, T, by_bias.copy(), doubt, q_pc.copy(), P.copy(), q, C)
    vertical, q_joint, A = up.copy(), np.empty((3, 4)), np.zeros((9, SIZE))
    sensor_to_segment.seated_row(q, m, k, q_joint, A)
    if span > 0:
        seen, told, rates, usable, change = (
            np.zeros((4, 3)),
            np.empty(4),
            np.empty(4),
            np.empty(3),
            np.empty(SIZE),
        )
        wrong, gives = np.empty(4), np.empty(3)
        for s in range(4):
            told[s] = (
                1.0
                if math.isfinite(acc[s, 0])
                and math.isfinite(acc[s, 1])
                and math.isfinite(acc[s, 2])
                else 0.0
            )
            rates[s] = (
                2
                * math.atan2(math.sqrt(T[s, 1] ** 2 + T[s, 2] ** 2 + T[s, 3] ** 2), abs(T[s, 0]))
                / span
            )
            for a in range(3):
                seen[s, a] = acc[s, a] if told[s] > 0 else 0.0
        for j in range(3):
            usable[j] = known[j] * told[j] * told[j + 1]
        finger_ekf_measurements.settled_row(up.copy(), T, seen, told, span, vertical)
        missed, H, noise = np.zeros(18), np.zeros((18, SIZE)), np.zeros((18, 18))
        inclination_noise.seen_row(p, span, seen, told, rates, fast, first, lies)
        inclination_noise.variances_row(p, fast, wrong)
        finger_ekf_measurements.vectors_row(
            p, q, seen, vertical, wrong, rates, usable, span, missed, H, noise
        )
        joint_compliance.believed_row(p, give, gives)
        finger_ekf_measurements.joints_row(
            p, q_joint, A, C, gives, free, limits, known, span, missed, H, noise
        )
        joint_compliance.learnt_row(p, q_pc, q, C, free, gives, span, missed, H, noise, give)
        correct(C, missed, H, noise, change)
        put_right(q, b, m, k, o, change)
        _headed(p, mag, vertical, rates, known, told, q, b, m, k, o, C)
        zero_rate_update.rested_row(
            p, T, bias_time, span, rates, q, b, m, k, o, C, resting, creeping, shown, differed
        )
    spread(A, C, of_joints)
    inclination_noise.by_biases_row(p, q_joint, first, lies, of_joints)
    for s in range(4):  # what opens now has not turned
        T[s, 0], T[s, 1], T[s, 2], T[s, 3] = 1.0, 0.0, 0.0, 0.0
    sensor_to_segment.joints_row(q, m, k, T, q_joint)
    put(q_joint, q_true)
    put(q, q_pc_new)
    put(b, bias_new)
    put(m, seat_new)
    put(k, skin_new)
    apart_new[0], apart_new[1] = o[0], o[1]
    put(C, P_new)
    put(vertical, up_new)
    put(creeping, crept_new)
    put(shown, rested_new)
    creep_new[0], creep_new[1] = differed[0], differed[1]
    put(first, began_new)
    put(lies, lies_new)
    put(give, give_new)
    for s in range(4):
        rest_new[s], lively_new[s] = resting[s], fast[s]


@rowwise("(j,q),(s,q),(j,v),(e,e),(d)->(d,d)")
def _covariance(
    q_pc: Array, seat: Array, skin: Array, P: Array, row: Array, of_joints: Array
) -> None:
    """That of the true joints' errors."""
    q_joint, A = np.empty((3, 4)), np.zeros((9, SIZE))
    sensor_to_segment.seated_row(q_pc.copy(), seat.copy(), skin.copy(), q_joint, A)
    spread(A, P.copy(), of_joints)


def _span(state: State) -> float:
    """Seconds since the newest update, 0 before the first."""
    return state.newest - state.t if np.isfinite(state.t) else 0.0


def _started(
    params: FilterParams, numbers: Array, state: State, samples: Samples, row: int
) -> State:
    """Joints that were not known before begin where the samples put them, as sure as a pose leaves them; the open window is settled first."""
    if state.newest > state.t:
        state = _settled(numbers, state)
    fresh = samples.known[row] & ~state.known
    q_pc, P = np.where(fresh[..., None], samples.q_first[row], state.q_pc), state.P.copy()
    posed = sensor_to_segment.after_pose(
        params, q_pc, np.nan_to_num(samples.acc[row]), state.free, state.seats
    )
    for f in np.flatnonzero(fresh.any(axis=1)):
        own = _own(fresh[f], first=bool(not state.known[f].any()))
        P[np.ix_([f], own, np.arange(SIZE))] = 0.0
        P[np.ix_([f], np.arange(SIZE), own)] = 0.0
        P[np.ix_([f], own, own)] = posed[np.ix_([f], own, own)]
    return replace(state, q_pc=q_pc, P=P, known=samples.known[row].copy())


def _own(fresh: Bools, first: bool) -> Indices:
    """Error states of the joints that begin: their rotations, seats and skins; the chain's first seat with the first of them."""
    own = np.concatenate([fresh, np.zeros(4, bool), [first], fresh, fresh])
    return np.flatnonzero(np.repeat(own, 3))


def _settled(numbers: Array, state: State) -> State:
    """The open window's end becomes the state; the covariance goes along."""
    q_pc, P = preintegration.carried(
        numbers, _span(state), state.turned, state.by_bias, state.doubt, state.q_pc, state.P
    )
    apart = np.stack(
        [state.apart[:, 0] * preintegration.alike(numbers, state.turned), state.apart[:, 1]], axis=1
    )
    return replace(state, **_opened(state), q_pc=q_pc, apart=apart, P=P)


def _opened(state: State) -> dict[str, Any]:
    """A new window begins with the newest sample."""
    by_bias, bias_time, doubt = _nothing(len(state.q_pc))
    return {
        "t": state.newest,
        "turned": _still(len(state.q_pc)),
        "by_bias": by_bias,
        "bias_time": bias_time,
        "doubt": doubt,
    }


def _still(chains: int) -> Array:
    """Sensors that have not turned (F, 4, 4)."""
    turned = np.zeros((chains, 4, 4))
    turned[..., 0] = 1.0
    return turned


def _nothing(chains: int) -> tuple[Array, Array, Array]:
    return np.zeros((chains, 4, 3, 3)), np.zeros((chains, 4)), np.zeros((chains, 4))


@cache
def _numbers(params: FilterParams) -> Array:
    """Options as the kernels take them."""
    of_gyr = np.radians(params.gyr_noise), params.gyr_scale, np.radians(params.bias_walk)
    return np.concatenate(
        [finger_ekf_measurements.numbers(params), of_gyr, magnetic_heading.numbers(params)]
    )
