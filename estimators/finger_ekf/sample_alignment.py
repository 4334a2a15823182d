"""Samples of all sensors on one time base, as the finger filters take them.

In      inertial blocks as they come; rows of fused orientations once every stream has got that far
Out     finger_ekf.Samples in the frames that the calibration gives the sensors: rotation since the previous row, vertical or specific force, rotation variance from gaps
Source  ours: where a gyroscope has no good sample (missing, saturated, of another rate) its rotation is that of the fused orientation, which gap_interpolation.py bridges with a variance; the bias is not in that rotation
Limits  accelerations of a stream with other instants are interpolated over two samples; where a
        stream's samples are not at the instants of the rows, its gyroscope biases are not estimated
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import ACC, GYR, MAG, SATURATION, Block, Stream, exceeds_row
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.finger_ekf.joint_acceleration.block_sums import Readings
from handscope.estimators.finger_ekf.mounting_change import SENSORS
from handscope.estimators.finger_ekf.samples import Samples
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.jit import inlined, looped, rowwise
from handscope.estimators.numerics.typing import Array, Bools, Indices
from handscope.estimators.orientation.fusion import LOST_VARIANCE
from handscope.estimators.orientation.resampling import Rows
from handscope.estimators.sensors.missing_samples import is_complete_row

MISSING, UNSURE = int(Flag.MISSING), int(Flag.MISSING | Flag.SATURATED)
# (6, 3) 1 for joints: the wrist's chain has one
_JOINTS = np.array([[1.0] * 3] * 5 + [[1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class WornSensors:
    """Which of a stream's sensors sit on the hand, and how."""

    columns: Indices  # of the stream
    segments: Indices
    bias: Array  # (worn, 3) rad/s, as the calibration has it
    q_BS: Array  # (worn, 4)


@dataclass(frozen=True)
class Waiting:
    """Samples of a stream's sensors on the hand in segment frames, the calibration's biases
    removed; NaN where not to be used."""

    stream: Stream
    worn: WornSensors
    period: float  # s, between samples as they come
    t: Array  # (n,)
    gyr: Array  # (n, worn, 3) rad/s
    acc: Array  # (n, worn, 3) m/s^2
    mag: Array | None = None  # (n, worn, 3) uT, where it is asked for


class StreamReadings(NamedTuple):
    """Samples that wait, as a kernel takes them."""

    t: Array  # (m,) s
    gyr: Array  # (m, worn, 3) rad/s
    acc: Array  # (m, worn, 3) m/s^2
    segments: Indices  # (worn,)
    period: float  # s


class SegmentReadings(NamedTuple):
    """A segment's own readings at n rows; NaN where it has none."""

    rate: Array  # (n, segments, 3) rad/s
    acc: Array  # (n, segments, 3) m/s^2


class FusedRows(NamedTuple):
    """Fused orientations at n rows and at the rows before them."""

    q_before: Array  # (n, segments, 4)
    variance_before: Array  # (n, segments) rad^2
    q_GB: Array  # (n, segments, 4)
    variance: Array  # (n, segments) rad^2
    flags: Array  # (n, segments)
    added_variance: Array  # (n, segments) rad^2, of sensors that appear or are noisier


class SensorTurns(NamedTuple):
    """What the sensors did since the row before."""

    turn: Array  # (segments, 3) rad
    bias_time: Array  # (segments,) s of the gyroscope's bias that is in it
    variance: Array  # (segments,) rad^2


class ChainRows(NamedTuple):
    """Of n rows and F chains, as finger_ekf.Samples has them, to be filled."""

    turn: Array  # (n, F, 4, 3)
    bias_time: Array  # (n, F, 4)
    force: Array  # (n, F, 4, 3)
    rotation_variance: Array  # (n, F, 4)
    known: Array  # (n, F, 3) 1 where both segments are measured
    q_first: Array  # (n, F, 3, 4)


@dataclass(frozen=True)
class State:
    """Samples that wait for the others, and the orientations reached, q_GB."""

    unposed: Bools  # (segments,) sensors unknown to the pose that have given nothing yet
    # (segments,) rad^2/s that its gyroscope's noise turns it by more than the filters assume
    noisy: Array
    posed: Array  # (segments, 4) q_GB in the pose, NaN where it is not known
    pose_end: float  # s, until when they lie so
    waiting: Mapping[str, Waiting] = field(default_factory=dict)
    t: float = -np.inf  # s, newest row
    q_GB: Array | None = None  # (segments, 4) there
    rotation_variance: Array | None = None  # (segments,) rad^2 there


def start(calibration: Calibration, gyr_noise: float) -> State:
    """Before the first samples; filters count with `gyr_noise`, rad/s/sqrt(Hz), and a sensor that
    was noisier in the pose misses that much more."""
    seen = [
        calibration.quality[s].rate_noise if s in calibration.quality else None for s in SEGMENTS
    ]
    noisy = np.array([max((n or 0.0) ** 2 - gyr_noise**2, 0.0) / 2 for n in seen])
    posed = np.full((len(SEGMENTS), 4), np.nan)
    for s, q_GS in calibration.q_GS.items():
        if s in calibration.q_BS:
            posed[SEGMENT[s]] = quat.multiply(q_GS, quat.conjugate(calibration.q_BS[s]))
    return State(
        np.array([s not in calibration.q_GS for s in SEGMENTS]), noisy, posed, calibration.end
    )


def buffer_blocks(
    state: State, blocks: Sequence[Block], calibration: Calibration, q_SB: Array
) -> State:
    """Keep the blocks' samples until their rows come, with their magnetometers' where the blocks
    have them."""
    waiting = dict(state.waiting)
    for block in blocks:
        before = waiting.get(block.stream.name)
        if before is None or before.stream != block.stream:
            before = _empty_buffer(block.stream, calibration, q_SB)
        if len(before.worn.columns):
            waiting[block.stream.name] = _behind(before, block)
    return replace(state, waiting=waiting)


def align_samples(
    state: State, rows: Rows, q_GB: Array, instant: bool, fused: bool, at_joint: bool = False
) -> tuple[State, Samples]:
    """The filters' samples at the rows, orientations q_GB (n, segments, 4) fused at the same;
    `instant`: gyroscopes tell the rate at the sample; `fused`: the vertical is that of the
    orientations, else the accelerometers'; `at_joint`: with what is felt at the thumb's base."""
    q_first, variance_first = (
        (q_GB[0], rows.rotation_variance[0])
        if state.q_GB is None or state.rotation_variance is None
        else (state.q_GB, state.rotation_variance)
    )
    q_before = np.concatenate([q_first[None], q_GB[:-1]])
    variance_before = np.concatenate([variance_first[None], rows.rotation_variance[:-1]])
    times = np.concatenate([[state.t if math.isfinite(state.t) else rows.t[0]], rows.t])
    dt = times[1:] - times[:-1]
    readings = SegmentReadings(*np.full((2, len(rows.t), len(SEGMENTS), 3), np.nan))
    for w in state.waiting.values():
        if len(w.t):
            arrived = StreamReadings(
                _for_kernel(w.t), _for_kernel(w.gyr), _for_kernel(w.acc), w.worn.segments, w.period
            )
            place_readings(
                arrived, _for_kernel(rows.t), dt, instant, at_joint or not fused, readings
            )
    unposed, appears = _appearing_sensors(state.unposed, q_GB)
    more = appears + state.noisy * dt[:, None]
    orientations = FusedRows(
        _for_kernel(q_before),
        _for_kernel(variance_before),
        _for_kernel(q_GB),
        _for_kernel(rows.rotation_variance),
        _for_kernel(rows.flags),
        _for_kernel(more),
    )
    chains = _empty_chains(len(rows.t))
    fill_chains(SENSORS, _JOINTS, dt, orientations, readings, fused, chains)
    turn, bias_time, force, grown, known, q_first = chains
    t = float(rows.t[-1])
    pruned = {name: _prune(w, t) for name, w in state.waiting.items()}
    if state.q_GB is None and rows.t[0] <= state.pose_end:
        q_first[0] = _first_rotations(state.posed, q_GB[0], q_first[0])
    after = State(
        unposed,
        state.noisy,
        state.posed,
        state.pose_end,
        pruned,
        t,
        q_GB[-1].copy(),
        rows.rotation_variance[-1].copy(),
    )
    return after, Samples(
        rows.t,
        turn,
        bias_time,
        force,
        grown,
        known > 0,
        q_first,
        _chain_fields(state.waiting.values(), rows.t),
        _at_thumbs_base(rows.t, turn, bias_time, readings, q_GB) if at_joint else None,
    )


def _at_thumbs_base(
    t: Array, turn: Array, bias_time: Array, readings: SegmentReadings, q_GB: Array
) -> Readings:
    """What the hand's and the thumb metacarpal's sensor feel."""
    both = SENSORS[0, :2]
    return Readings(t, turn[:, 0, :2], bias_time[:, 0, :2], readings.acc[:, both], q_GB[:, both])


def _first_rotations(posed: Array, q_GB: Array, q_first: Array) -> Array:
    """Rotations (F, 3, 4) of the joints at the first row: those of the whole pose, where a fusion
    has no more than its first sample yet."""
    q = np.where(np.isfinite(posed), posed, q_GB)[SENSORS]
    q_pose = quat.relative(q[:, :-1], q[:, 1:])
    return np.asarray(np.where(np.isfinite(q_pose), q_pose, q_first))


def _chain_fields(waiting: Collection[Waiting], t: Array) -> Array | None:
    """Fields (n, F, 2, 3) at the chains' first and last sensors, the newest not after t; NaN where
    there are none, None where none is asked for."""
    if all(w.mag is None for w in waiting):
        return None
    found = np.full((len(t), len(SEGMENTS), 3), np.nan)
    for w in waiting:
        if w.mag is not None and len(w.t):
            newest = w.t.searchsorted(t, side="right") - 1
            recent = (newest >= 0) & (t - w.t[newest] < 1.5 * w.period)
            found[:, w.worn.segments] = np.where(recent[:, None, None], w.mag[newest], np.nan)
    return found[:, SENSORS[:, [0, 3]]]


def _appearing_sensors(unposed: Bools, q_GB: Array) -> tuple[Bools, Array]:
    """Which sensors are still to appear of those of which the pose knows nothing, and the variance
    (n, segments) of one that does."""
    present = np.isfinite(q_GB[:, unposed, 0])
    if not present.any():
        return unposed, np.zeros(len(SEGMENTS))
    variance = np.zeros(q_GB.shape[:2])
    variance[:, unposed] = np.where(present & (np.cumsum(present, axis=0) == 1), LOST_VARIANCE, 0.0)
    still = unposed.copy()
    still[unposed] = ~present.any(axis=0)
    return still, variance


def _empty_buffer(stream: Stream, calibration: Calibration, q_SB: Array) -> Waiting:
    """A stream before its first samples."""
    columns = [k for k, name in enumerate(stream.sensors) if name in SEGMENT]
    names = [stream.sensors[k] for k in columns]
    segments = np.array([SEGMENT[name] for name in names], np.intp)
    bias = np.array([calibration.gyr_bias.get(name, np.zeros(3)) for name in names]).reshape(-1, 3)
    worn = WornSensors(np.array(columns, np.intp), segments, bias, quat.conjugate(q_SB[segments]))
    nothing = np.empty((0, len(columns), 3))
    period, mag = (
        1.0 / calibration.rates.get(stream.name, stream.rate),
        nothing if MAG in stream.quantities else None,
    )
    return Waiting(stream, worn, period, np.empty(0), nothing, nothing, mag)


def _behind(before: Waiting, block: Block) -> Waiting:
    """What waits of a stream, with a block more."""
    gyr, acc = _segment_readings(before.worn, block)
    mag = before.mag
    if mag is not None:
        mag = np.concatenate([mag, _segment_fields(before.worn, block)])
    t, gyr, acc = (
        np.concatenate(both) for both in ((before.t, block.t), (before.gyr, gyr), (before.acc, acc))
    )
    return Waiting(before.stream, before.worn, before.period, t, gyr, acc, mag)


def _segment_readings(worn: WornSensors, block: Block) -> tuple[Array, Array]:
    """Rates and specific forces (n, worn, 3) in segment frames; NaN where missing or at the
    sensor's limit."""
    limits = [SATURATION * block.stream.full_scale.get(quantity, np.inf) for quantity in (GYR, ACC)]
    gyr, acc = _in_segments(
        block.of(GYR), block.of(ACC), worn.columns, worn.bias, worn.q_BS, *limits
    )
    return gyr, acc


def _segment_fields(worn: WornSensors, block: Block) -> Array:
    """Magnetic fields (n, worn, 3) in segment frames, uT."""
    return 1e6 * quat.rotate(worn.q_BS, block.of(MAG)[:, worn.columns])


@rowwise("(c,v),(c,v),(w),(w,v),(w,q),(),()->(w,v),(w,v)")
def _in_segments(
    gyr: Array,
    acc: Array,
    columns: Array,
    bias: Array,
    q_BS: Array,
    fastest: float,
    hardest: float,
    rate: Array,
    force: Array,
) -> None:
    unbiased, whole, at_limit = np.empty(3), np.empty(1, np.bool_), np.empty(1, np.bool_)
    for w in range(columns.shape[0]):
        c = int(columns[w])
        is_complete_row(gyr[c], acc[c], whole)
        for a in range(3):
            unbiased[a] = gyr[c, a] - bias[w, a]
        quat.rotate_row(q_BS[w], unbiased, rate[w])
        quat.rotate_row(q_BS[w], acc[c], force[w])
        exceeds_row(gyr[c], fastest, at_limit)
        if not whole[0] or at_limit[0]:
            rate[w, 0], rate[w, 1], rate[w, 2] = math.nan, math.nan, math.nan
        exceeds_row(acc[c], hardest, at_limit)
        if not whole[0] or at_limit[0]:
            force[w, 0], force[w, 1], force[w, 2] = math.nan, math.nan, math.nan


@inlined
def _up_row(q_GB: Array, up: Array) -> None:
    """The vertical in a frame: the last row of its rotation matrix."""
    w, x, y, z = q_GB[0], q_GB[1], q_GB[2], q_GB[3]
    up[0], up[1], up[2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z


def _for_kernel(a: NDArray[Any]) -> Array:
    """As kernels are translated for: float64, C-contiguous."""
    return np.ascontiguousarray(a, np.float64)


def _empty_chains(n: int) -> ChainRows:
    chains, sensors = SENSORS.shape
    turn, force = np.empty((2, n, chains, sensors, 3))
    bias_time, variance = np.empty((2, n, chains, sensors))
    known, q_first = np.empty((n, *_JOINTS.shape)), np.empty((n, *_JOINTS.shape, 4))
    return ChainRows(turn, bias_time, force, variance, known, q_first)


@inlined
def sensor_turns(
    n: int, dt: float, orientations: FusedRows, readings: SegmentReadings, turns: SensorTurns
) -> None:
    """Fill what every sensor turned by: by its own rates where it has them, else by its fusion's
    orientations, which bridge what is missing and count a gap."""
    step, w = np.empty(4), np.empty(3)
    for s in range(len(turns.turn)):
        by, rate, q_GB = turns.turn[s], readings.rate[n, s], orientations.q_GB[n, s]
        more = max(orientations.variance[n, s] - orientations.variance_before[n, s], 0.0)
        turns.bias_time[s] = 0.0
        if math.isfinite(rate[0] + rate[1] + rate[2]):
            turns.bias_time[s] = dt
            for a in range(3):
                by[a] = rate[a] * dt
        else:
            quat.relative_row(orientations.q_before[n, s], q_GB, step)
            quat.log_row(step, w, w)
            for a in range(3):
                by[a] = w[a] if math.isfinite(w[a]) else 0.0
        turns.variance[s] = more + orientations.added_variance[n, s]


@looped
def fill_chains(
    sensors: Indices,
    joints: Array,
    dt: Array,
    orientations: FusedRows,
    readings: SegmentReadings,
    fused: bool,
    chains: ChainRows,
) -> None:
    """Fill what the sensors (F, 4) and joints (F, 3) of every chain did since the row before;
    `fused`: the vertical is that of the orientations."""
    segments = orientations.q_GB.shape[1]
    turns = SensorTurns(np.empty((segments, 3)), np.empty(segments), np.empty(segments))
    up = np.empty(3)
    for n in range(len(dt)):
        q_GB = orientations.q_GB[n]
        sensor_turns(n, dt[n], orientations, readings, turns)
        for c in range(sensors.shape[0]):
            for k in range(sensors.shape[1]):
                s = sensors[c, k]
                chains.bias_time[n, c, k] = turns.bias_time[s]
                chains.rotation_variance[n, c, k] = turns.variance[s]
                unsure = int(orientations.flags[n, s]) & UNSURE
                _up_row(q_GB[s], up)
                for a in range(3):
                    vertical = GRAVITY * up[a] if fused else readings.acc[n, s, a]
                    chains.turn[n, c, k, a] = turns.turn[s, a]
                    chains.force[n, c, k, a] = math.nan if unsure else vertical
            for j in range(joints.shape[1]):
                p, s = sensors[c, j], sensors[c, j + 1]
                is_known = math.isfinite(q_GB[p, 0]) and math.isfinite(q_GB[s, 0])
                chains.known[n, c, j] = joints[c, j] if is_known else 0.0
                if chains.known[n, c, j] > 0:
                    quat.relative_row(q_GB[p], q_GB[s], chains.q_first[n, c, j])
                else:
                    for a in range(4):
                        chains.q_first[n, c, j, a] = 1.0 if a == 0 else 0.0


@looped
def place_readings(
    stream: StreamReadings,
    t: Array,
    dt: Array,
    instant: bool,
    forces: bool,
    readings: SegmentReadings,
) -> None:
    """Fill a stream's own rates where it has a sample at the row and the one before, and its
    specific forces where they are asked for."""
    known_t, gyr, acc, period, own = stream.t, stream.gyr, stream.acc, stream.period, np.empty(3)
    for n in range(len(t)):
        after = min(np.searchsorted(known_t, t[n]), known_t.shape[0] - 1)
        before = max(after - 1, 0)
        at, span = known_t[after], known_t[after] - known_t[before]
        is_regular = abs(dt[n] - period) < 0.25 * period and abs(span - period) < 0.25 * period
        inside = known_t[before] <= t[n] and t[n] <= at and span > 0 and span < 1.5 * period
        weight = (t[n] - known_t[before]) / (span if inside else 1.0)
        for w in range(stream.segments.shape[0]):
            s = stream.segments[w]
            for a in range(3):
                own[a] = (
                    0.5 * (gyr[after, w, a] + gyr[before, w, a]) if instant else gyr[after, w, a]
                )
                if forces and (at == t[n] or inside):
                    readings.acc[n, s, a] = (
                        acc[after, w, a]
                        if at == t[n]
                        else acc[before, w, a] * (1 - weight) + acc[after, w, a] * weight
                    )
            is_known = math.isfinite(own[0]) and math.isfinite(own[1]) and math.isfinite(own[2])
            if at == t[n] and is_regular and is_known:
                for a in range(3):
                    readings.rate[n, s, a] = own[a]


def _prune(waiting: Waiting, t: float) -> Waiting:
    """Forget what lies before the last sample not after t."""
    first = max(int(waiting.t.searchsorted(t, side="right")) - 1, 0)
    pruned = (
        waiting.t[first:],
        waiting.gyr[first:],
        waiting.acc[first:],
        None if waiting.mag is None else waiting.mag[first:],
    )
    return Waiting(waiting.stream, waiting.worn, waiting.period, *pruned)
