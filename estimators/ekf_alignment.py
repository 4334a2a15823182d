"""Samples of all sensors at the instants of the rows, as the fingers' filters take them.

In      inertial blocks as they come; rows of fused orientations once every stream has got that far
Out     finger_ekf.Samples in the frames that the calibration gives the sensors: turns since the row before, the vertical or specific forces, what may
        have been missed
Source  ours: where a gyroscope has no good sample (missing, at its limit, of another rate) its turn is that of the fused orientation, which is bridged
        by estimators/bridging.py and tells how much that may have missed; its bias is not in that turn
Limits  accelerations of a stream with other instants are interpolated over two samples; where a stream's samples are not at the instants of the rows,
        its gyroscopes' biases are not found
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimators import quaternions as quat
from estimators.calibration import Calibration
from estimators.ekf_updates import GRAVITY
from estimators.finger_ekf import Samples
from estimators.forward_kinematics import CHAIN_SEGMENTS
from estimators.hand_anatomy import SEGMENT, SEGMENTS
from estimators.missing_samples import complete
from estimators.quaternions import Array
from estimators.samples import ACC, GYR, Block, Stream
from estimators.sensor_fusion import LOST_DOUBT
from estimators.time_base import Rows
from estimators.trajectory import Flag

_UNSURE = np.uint8(Flag.MISSING | Flag.SATURATED)
_WRIST = [SEGMENT[s] for s in ("forearm", "hand", "hand", "hand")]
SENSORS = np.vstack([np.column_stack([np.full(5, SEGMENT["hand"]), CHAIN_SEGMENTS]), _WRIST])  # (6, 4) segments of each chain's sensors
_JOINTS = np.array([[True] * 3] * 5 + [[True, False, False]])  # (6, 3) which of them are joints: the wrist's chain has one


@dataclass(frozen=True)
class Waiting:
    """Samples of a stream in segment frames, the calibration's biases removed; NaN where not to be used."""

    stream: Stream
    period: float  # s, between samples as they come
    t: Array  # (n,)
    gyr: Array  # (n, sensors, 3) rad/s
    acc: Array  # (n, sensors, 3) m/s^2


@dataclass(frozen=True)
class State:
    strange: NDArray[np.bool_]  # (segments,) the pose knows nothing of the sensor, and it has given nothing yet
    bias: Array  # (segments, 3) rad/s, as the calibration has it
    waiting: Mapping[str, Waiting] = field(default_factory=dict)
    t: float = -np.inf  # s, newest row
    q_GB: Array | None = None  # (segments, 4) there
    doubt: Array | None = None  # (segments,) rad^2 there


def start(calibration: Calibration) -> State:
    bias = np.array([calibration.gyr_bias.get(s, np.zeros(3)) for s in SEGMENTS])
    return State(np.array([s not in calibration.q_GS for s in SEGMENTS]), bias)


def taken(state: State, block: Block, calibration: Calibration, q_SB: Array) -> State:
    """Keep a block's samples until their rows come."""
    fresh = _in_segments(block, calibration, state.bias, q_SB)
    before = state.waiting.get(block.stream.name)
    if before is not None and before.stream == block.stream:
        t, gyr, acc = (np.concatenate([getattr(before, n), getattr(fresh, n)]) for n in ("t", "gyr", "acc"))
        fresh = replace(fresh, t=t, gyr=gyr, acc=acc)
    return replace(state, waiting={**state.waiting, block.stream.name: fresh})


def aligned(state: State, rows: Rows, q_GB: Array, instant: bool, fused: bool, max_gap: float) -> tuple[State, Samples]:
    """The filters' samples at the rows, orientations q_GB (n, segments, 4) fused at the same; `instant`: gyroscopes tell the rate at the sample;
    `fused`: the vertical is that of the orientations, else the accelerometers'."""
    first = state.q_GB if state.q_GB is not None else q_GB[0]
    step = quat.relative(np.concatenate([first[None], q_GB[:-1]]), q_GB)
    turn = quat.log(np.where(np.isnan(step), quat.IDENTITY, step))
    dt = np.diff(rows.t, prepend=state.t if np.isfinite(state.t) else rows.t[0])
    bias_time, acc = np.zeros(turn.shape[:2]), np.full(turn.shape, np.nan)
    for waiting in state.waiting.values():
        _place(waiting, rows.t, dt, instant, turn, bias_time, None if fused else acc)
    grown = np.maximum(np.diff(rows.doubt, axis=0, prepend=(rows.doubt[:1] if state.doubt is None else state.doubt[None])), 0.0)
    present = np.isfinite(q_GB[..., 0])
    # the fusion counts a gap once; what is silent goes on turning
    held = ((rows.flags & Flag.MISSING) != 0) & (turn == 0).all(axis=-1) & present
    grown += np.where(held, LOST_DOUBT / max(max_gap, 0.01) * dt[:, None], 0.0)
    appears = state.strange & present & (np.cumsum(present, axis=0) == 1)
    grown += np.where(appears, LOST_DOUBT, 0.0)
    if fused:
        acc = GRAVITY * _upwards(q_GB)
    acc[(rows.flags & _UNSURE) != 0] = np.nan
    known = present[:, SENSORS[:, :3]] & present[:, SENSORS[:, 1:]] & _JOINTS
    q_first = np.where(known[..., None], quat.relative(q_GB[:, SENSORS[:, :3]], q_GB[:, SENSORS[:, 1:]]), quat.IDENTITY)
    kept = {name: _pruned(w, float(rows.t[-1])) for name, w in state.waiting.items()}
    samples = Samples(rows.t, turn[:, SENSORS], bias_time[:, SENSORS], acc[:, SENSORS], grown[:, SENSORS], known, q_first)
    after = replace(
        state,
        strange=state.strange & ~present.any(axis=0),
        waiting=kept,
        t=float(rows.t[-1]),
        q_GB=q_GB[-1].copy(),
        doubt=rows.doubt[-1].copy(),
    )
    return after, samples


def _upwards(q_GB: Array) -> Array:
    """The vertical (..., 3) in each frame: the last row of its rotation matrix."""
    w, x, y, z = (q_GB[..., k] for k in range(4))
    return np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z], axis=-1)


def _in_segments(block: Block, calibration: Calibration, bias: Array, q_SB: Array) -> Waiting:
    """Calibrated samples in segment frames; NaN where missing or at the sensor's limit."""
    gyr, acc, whole = block.of(GYR), block.of(ACC), complete(block)
    columns, segments = worn(block.stream.sensors)
    known_bias, q_BS = np.zeros((len(whole.T), 3)), np.tile(quat.IDENTITY, (len(whole.T), 1))
    known_bias[columns], q_BS[columns] = bias[segments], quat.conjugate(q_SB[segments])
    return Waiting(
        block.stream,
        1.0 / calibration.rates.get(block.stream.name, block.stream.rate),
        block.t,
        np.where((whole & ~block.at_limit(GYR))[..., None], quat.rotate(q_BS, gyr - known_bias), np.nan),
        np.where((whole & ~block.at_limit(ACC))[..., None], quat.rotate(q_BS, acc), np.nan),
    )


@cache
def worn(sensors: tuple[str, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which of a stream's sensors sit on the hand, and on which segments."""
    columns = [k for k, name in enumerate(sensors) if name in SEGMENT]
    return np.array(columns, np.intp), np.array([SEGMENT[sensors[k]] for k in columns], np.intp)


def _place(waiting: Waiting, t: Array, dt: Array, instant: bool, turn: Array, bias_time: Array, acc: Array | None) -> None:
    """Write a stream's own samples over the turns of the fusion, and its specific forces where they are asked for."""
    sensors, segments = worn(waiting.stream.sensors)
    if not len(sensors) or len(waiting.t) == 0:
        return
    after = np.minimum(np.searchsorted(waiting.t, t), len(waiting.t) - 1)
    before = np.maximum(after - 1, 0)
    period = waiting.period
    here = waiting.t[after] == t
    gyr = waiting.gyr[:, sensors]
    rates = 0.5 * (gyr[after] + gyr[before]) if instant else gyr[after]
    regular = here & (np.abs(dt - period) < 0.25 * period) & (np.abs(waiting.t[after] - waiting.t[before] - period) < 0.25 * period)
    own = regular[:, None] & np.isfinite(rates).all(axis=-1)
    turn[:, segments] = np.where(own[..., None], rates * dt[:, None, None], turn[:, segments])
    bias_time[:, segments] = np.where(own, dt[:, None], bias_time[:, segments])
    if acc is not None:
        acc[:, segments] = _between(waiting.t, waiting.acc[:, sensors], t, before, after, 1.5 * period, acc[:, segments])


def _between(
    known_t: Array, values: Array, t: Array, before: NDArray[np.int_], after: NDArray[np.int_], longest: float, otherwise: Array
) -> Array:
    """Values (n, sensors, 3) at t between their neighbours; `otherwise` where those are not within reach."""
    span = known_t[after] - known_t[before]
    inside = (known_t[before] <= t) & (t <= known_t[after]) & (span > 0) & (span < longest)
    weight = np.where(inside, (t - known_t[before]) / np.where(span > 0, span, 1.0), 1.0)[:, None, None]
    here = (known_t[after] == t)[:, None, None]
    mixed = values[before] * (1 - weight) + values[after] * weight
    return np.where(here, values[after], np.where(inside[:, None, None], mixed, otherwise))


def _pruned(waiting: Waiting, t: float) -> Waiting:
    """Forget what lies before the last sample not after t."""
    first = max(int(np.searchsorted(waiting.t, t, side="right")) - 1, 0)
    return replace(waiting, t=waiting.t[first:], gyr=waiting.gyr[first:], acc=waiting.acc[first:])
