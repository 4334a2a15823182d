"""Orientation of every sensor of a stream in the global frame, from its gyroscope, accelerometer
and, if wanted, magnetometer.

In      blocks of one stream, rad/s, m/s^2 and T in the sensors' frames; NaN or a jump in time is a
        missing sample
Out     q_GS: takes vectors from a sensor to the global frame (z up); flags
Source  VQF: Laidig & Seel 2023, Information Fusion 91:187 (package vqf), successor of the filter in
        Salchow-Hoemmen 2019, (17) and (18); the magnetometer corrects the heading only
Limits  without magnetometer the heading drifts with what is left of the gyroscope's bias; a gap
        longer than `max_gap` loses it
"""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vqf import VQF

from handscope.estimators.data.samples import MAG, Block, Stream, every
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.gap_interpolation import RECENT, bridge_gaps, missed_variance
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation.fusion_state import JointState, SensorState
from handscope.estimators.orientation.fusion_state import Oriented as Oriented
from handscope.estimators.orientation.fusion_state import StreamState as StreamState
from handscope.estimators.orientation.vqf_bank import (
    FilterBank,
    FilterCache,
    start_filter,
    update_filter,
)
from handscope.estimators.orientation.vqf_bank import FusionParams as FusionParams
from handscope.estimators.sensors.missing_samples import check_samples, insert_missing_instants

# rad^2, ours: what a hand may have turned while a sensor was silent
LOST_VARIANCE = np.radians(60.0) ** 2


def start(
    stream: Stream,
    starts: Mapping[str, Array],
    biases: Mapping[str, Array],
    known_until: float = np.inf,
    norths: Mapping[str, float] | None = None,
    rate: float | None = None,
) -> StreamState:
    """Begin with known orientations q_GS (4,), gyroscope biases (3,) and headings of magnetic north
    by sensor; what is not known starts from gravity.

    `rate` (Hz) is that at which samples come, where it is not the one that the stream names.
    """
    known = norths or {}
    sensors = (
        SensorState(starts.get(s), biases.get(s, np.zeros(3)), known_until, known.get(s))
        for s in stream.sensors
    )
    period, nothing = 1.0 / (rate or stream.rate), np.empty((0, len(stream.sensors), 3))
    return StreamState(stream, tuple(sensors), period, nothing)


def step(params: FusionParams, state: StreamState, block: Block) -> tuple[StreamState, Oriented]:
    """Advance by one block; samples behind an open gap are held until it closes or grows longer
    than `max_gap`."""
    block, sampled = insert_missing_instants(block, state.t, state.period, params.max_gap)
    block, sampled = _prepend_held(state, block, sampled)
    whole, limit = check_samples(block)
    return _advance(
        params,
        state,
        block,
        sampled,
        whole,
        limit,
        _count_processable(params, state, block.t, whole),
    )


def finish(params: FusionParams, state: StreamState) -> tuple[StreamState, Oriented]:
    """Give out what is still held: at the end of the recording an open gap is a loss."""
    nothing = Block(
        state.stream,
        np.empty(0),
        np.empty((0, len(state.stream.sensors), 3 * len(state.stream.quantities))),
    )
    held, sampled = _prepend_held(state, nothing, np.empty(0, bool))
    whole, limit = check_samples(held)
    return _advance(params, state, held, sampled, whole, limit, len(held.t))


def _advance(
    params: FusionParams,
    state: StreamState,
    block: Block,
    sampled: Bools,
    whole: Bools,
    limit: Bools,
    count: int,
) -> tuple[StreamState, Oriented]:
    """Process the first `count` rows and hold the others; `limit` (n, sensors) marks samples at the
    sensor's limit."""
    settled, held = (
        Block(block.stream, block.t[:count], block.values[:count]),
        Block(block.stream, block.t[count:], block.values[count:]),
    )
    fused = state.fused
    if count and isinstance(fused, JointState) and whole[:count].all():  # what is almost always so
        fused, q_GS = _run_together(params, fused, state.period, settled)
        flags = np.uint8(Flag.SATURATED) * limit[:count] | fused.headless
        rotation_variance = np.repeat(fused.rotation_variance[None], count, axis=0)
    else:
        flags = (
            np.uint8(Flag.SATURATED) * limit[:count]
            | np.uint8(Flag.MISSING) * ~(whole | limit)[:count]
        )
        vqf, sensors, q_GS, rotation_variance = (
            start_filter(params, state.period),
            [],
            np.empty((count, whole.shape[1], 4)),
            np.empty((count, whole.shape[1])),
        )
        for k, sensor in enumerate(state.sensors):
            after, q_GS[:, k], more, rotation_variance[:, k] = _fuse(
                params, sensor, vqf, block, whole[:, k], k, count, state.recent[:, k]
            )
            flags[:, k] |= more
            sensors.append(after)
        fused = _join_sensors(params, state.period, tuple(sensors), block.values)
    newest = float(block.t[-1]) if len(block.t) else state.t
    rates = _rates(settled.values[-RECENT:], whole[:count][-RECENT:])
    after_all = StreamState(
        state.stream,
        fused,
        state.period,
        np.concatenate([state.recent, rates])[-RECENT:],
        newest,
        held if len(held.t) else None,
        sampled[count:],
    )
    return after_all, Oriented(settled.t, q_GS, flags, rotation_variance, sampled[:count])


def _join_sensors(
    params: FusionParams, period: float, sensors: tuple[SensorState, ...], samples: Array
) -> tuple[SensorState, ...] | JointState:
    """The sensors together where all go on, and from gyroscope and accelerometer alone."""
    if not sensors or not all(s.is_running and not _has_north(s, samples) for s in sensors):
        return sensors
    filters = FilterBank(
        params,
        period,
        tuple(FilterCache(s.filter_state, 0) for s in sensors if s.filter_state is not None),
    )
    bias, headless, rotation_variance, last, q_GS = (
        np.array([getattr(s, n) for s in sensors])
        for n in ("bias", "headless", "rotation_variance", "last", "q_GS")
    )
    return JointState(
        sensors, bias, headless, rotation_variance, filters, last, sensors[0].last_t, q_GS
    )


def _prepend_held(state: StreamState, block: Block, sampled: Bools) -> tuple[Block, Bools]:
    if state.held is None:
        return block, sampled
    t, values = (
        np.concatenate([state.held.t, block.t]),
        np.concatenate([state.held.values, block.values]),
    )
    return Block(block.stream, t, values), np.concatenate([state.held_sampled, sampled])


def _count_processable(params: FusionParams, state: StreamState, t: Array, whole: Bools) -> int:
    """How many rows can be processed: all before the first gap that is still open and may yet be
    bridged, cutting no other such gap."""
    count = len(t)
    if whole.all():
        return count
    while True:
        fewer = min(
            (_before_gap(params, s, t, c, count) for s, c in zip(state.sensors, whole.T)),
            default=count,
        )
        if fewer == count:
            return count
        count = fewer


def _before_gap(
    params: FusionParams, sensor: SensorState, t: Array, whole: Bools, count: int
) -> int:
    """`count`, or where the sensor's gap begins that may be bridged and reaches beyond the first
    `count` rows or to the last row but one."""
    good = np.flatnonzero(whole[:count])
    first = int(good[-1]) + 1 if len(good) else 0
    if first == count:
        return _before_last_gap(params, sensor, t, good, count) if count == len(t) else count
    before = t[good[-1]] if len(good) else (-np.inf if sensor.absent else sensor.last_t)
    behind = np.flatnonzero(whole[count:])
    end = t[count + behind[0]] if len(behind) else t[-1]
    return first if end - before <= params.max_gap else count


def _before_last_gap(
    params: FusionParams, sensor: SensorState, t: Array, good: NDArray[np.int_], count: int
) -> int:
    """`count`, or where the gap begins that ends just before the last row: the row behind it has
    yet to tell the slope."""
    first = int(good[-2]) + 1 if len(good) > 1 else 0
    if first == count - 1:
        return count
    before = t[first - 1] if first > 0 else (-np.inf if sensor.absent else sensor.last_t)
    return first if t[count - 1] - before <= params.max_gap else count


def _fuse(
    params: FusionParams,
    sensor: SensorState,
    vqf: VQF,
    block: Block,
    whole: Bools,
    k: int,
    count: int,
    recent: Array,
) -> tuple[SensorState, Array, NDArray[np.uint8], Array]:
    """Over the first `count` rows bridge short gaps, run the filter over what is known, hold the
    orientation where nothing is."""
    q_GS, flags, rotation_variance = (
        np.full((count, 4), np.nan),
        np.zeros(count, np.uint8),
        np.empty(count),
    )
    for first, last, known in _known_stretches(params, sensor, block.t[:count], whole[:count]):
        if known:
            late = (
                sensor.start is not None
                and sensor.filter_state is None
                and block.t[first] - sensor.known_until > params.max_gap
            )
            sensor = (
                replace(
                    sensor, lost=True, rotation_variance=sensor.rotation_variance + LOST_VARIANCE
                )
                if late
                else sensor
            )
            filled, rotation_variance[first:last] = _bridge_gaps(
                sensor, block, k, whole, first, last, recent
            )
            sensor, q_GS[first:last], disturbed = _filter(
                params, sensor, vqf, block, filled, first, last
            )
            fresh = (
                _from_first(every(np.isfinite(filled[:, 6:])))
                if _has_north(sensor, filled)
                else np.zeros(last - first, bool)
            )
            flags[first:last] = (
                np.where(fresh, np.uint8(0), sensor.headless) | np.uint8(Flag.MAGNETIC) * disturbed
            )
            known_now = (
                float(rotation_variance[last - 1]),
                bool(sensor.lost and not fresh[-1]),
                bool(sensor.has_north or fresh[-1]),
            )
            if known_now != (
                sensor.rotation_variance,
                sensor.lost,
                sensor.has_north,
            ):  # rarely: a copy of all fields costs as much as the filter's step
                sensor = replace(
                    sensor,
                    rotation_variance=known_now[0],
                    lost=known_now[1],
                    has_north=known_now[2],
                )
        else:
            begins = not sensor.absent and sensor.q_GS is not None
            sensor = replace(
                sensor,
                absent=True,
                lost=sensor.lost or sensor.q_GS is not None,
                rotation_variance=sensor.rotation_variance + (LOST_VARIANCE if begins else 0.0),
            )
            rotation_variance[first:last] = sensor.rotation_variance
            q_GS[first:last] = sensor.q_GS if sensor.q_GS is not None else np.nan
            flags[first:last] = sensor.headless
    return sensor, q_GS, flags, rotation_variance


def _from_first(flags: Bools) -> Bools:
    """True from the first true flag on."""
    return np.asarray(np.logical_or.accumulate(flags))


def _has_north(sensor: SensorState, samples: Array) -> bool:
    """Whether a magnetometer may turn this sensor: one that gave nothing in the pose has no
    relation to the pose's heading."""
    return samples.shape[-1] > 6 and (sensor.start is None or sensor.north is not None)


def _known_stretches(
    params: FusionParams, sensor: SensorState, t: Array, whole: Bools
) -> list[tuple[int, int, bool]]:
    """Cut rows into (first, last, known): known rows are complete or lie in a gap that is
    bridged."""
    if whole.all():
        return [(0, len(t), True)] if len(t) else []
    known = whole.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~whole, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2]):
        before = t[first - 1] if first > 0 else (-np.inf if sensor.absent else sensor.last_t)
        known[first:last] = last < len(t) and t[last] - before <= params.max_gap
    cuts = [0, *(np.flatnonzero(np.diff(known.astype(int))) + 1), len(t)]
    return [(int(a), int(b), bool(known[a])) for a, b in itertools.pairwise(cuts) if b > a]


def _bridge_gaps(
    sensor: SensorState,
    block: Block,
    k: int,
    whole: Bools,
    first: int,
    last: int,
    recent: Array,
) -> tuple[Array, Array]:
    """Rows first..last of sensor k with gaps filled in, and the variance (rows,) of the heading
    that gaps have cost so far; `recent` rates (h, 3) are those before the block."""
    inside = block.values[first:last, k, : 9 if MAG in block.stream.quantities else 6]
    if whole[first:last].all():
        return inside, np.full(last - first, sensor.rotation_variance)
    rows = slice(first, last + 1)  # one row more gives the slope
    t = np.concatenate([[sensor.previous_t, sensor.last_t], block.t[rows]])
    values = np.concatenate(
        [
            [_nan_if_missing(sensor.previous)],
            [_nan_if_missing(sensor.last)],
            block.values[rows, k, :6],
        ]
    )
    known = np.concatenate(
        [[sensor.previous is not None, sensor.last is not None and not sensor.absent], whole[rows]]
    )
    filled = bridge_gaps(t, values, known)
    # but for the newest, with which `t[1:]` begins
    earlier = np.concatenate([recent, _rates(block.values[:first, k], whole[:first])])[:-1]
    rates = values[1:, :3] - sensor.bias
    steps = missed_variance(t[1:], rates, known[1:], earlier - sensor.bias)[1 : 1 + last - first]
    rotation_variance = np.cumsum(np.concatenate([[sensor.rotation_variance], steps]))[1:]
    return np.concatenate([filled[2 : 2 + last - first], inside[:, 6:]], axis=-1), rotation_variance


def _rates(values: Array, whole: Bools) -> Array:
    """Rates (..., 3) of samples, NaN where they are not whole."""
    return np.where(whole[..., None], values[..., :3], np.nan)


def _nan_if_missing(sample: Array | None) -> Array:
    return np.full(6, np.nan) if sample is None else sample


def _run_together(
    params: FusionParams, before: JointState, period: float, block: Block
) -> tuple[JointState, Array]:
    """All sensors over complete samples, orientations (n, sensors, 4): common work is done once."""
    samples, t = np.ascontiguousarray(block.values[..., :6].swapaxes(0, 1)), block.t
    rates = samples[..., :3]
    if params.gyr_reading != "mean":
        rates = _midway_rates(before.last[:, None, :3], rates)
    gyr, acc = rates - before.bias[:, None], samples[..., 3:].copy()
    filters = before.filters
    if filters.params is not params:  # saved and loaded, or other options from here on
        filters = FilterBank(
            params, period, tuple(FilterCache(state, 0) for state in filters.states())
        )
    filters, q_GS = filters.advance(gyr, acc)
    previous, previous_t = (
        (samples[:, -2].copy(), float(t[-2])) if len(t) > 1 else (before.last, before.last_t)
    )
    newest = filters, samples[:, -1].copy(), float(t[-1]), q_GS[-1].copy(), previous, previous_t
    return JointState(
        before.initial, before.bias, before.headless, before.rotation_variance, *newest
    ), q_GS


def _next_state(
    sensor: SensorState, vqf: VQF, t: Array, samples: Array, q_GS: Array
) -> SensorState:
    """A sensor behind samples (n, 6 or more) at t (n,), its newest orientation q_GS (4,)."""
    before = samples[-2, :6].copy() if len(t) > 1 else None if sensor.absent else sensor.last
    before_t, last, last_t = (
        float(t[-2]) if len(t) > 1 else sensor.last_t,
        samples[-1, :6].copy(),
        float(t[-1]),
    )
    # `replace` would cost as much as the filter's step
    known = (
        sensor.start,
        sensor.bias,
        sensor.known_until,
        sensor.north,
    )
    return SensorState(
        *known,
        vqf.state,
        last,
        last_t,
        before,
        before_t,
        q_GS.copy(),
        sensor.rotation_variance,
        sensor.lost,
        sensor.has_north,
        absent=False,
    )


def _filter(
    params: FusionParams,
    sensor: SensorState,
    vqf: VQF,
    block: Block,
    samples: Array,
    first: int,
    last: int,
) -> tuple[SensorState, Array, Bools]:
    """Orientations (n, 4) of rows first..last, and where the magnetometer saw another field than
    the one learnt (n,)."""
    if not sensor.is_running:
        vqf.resetState()
    vqf.state = (
        sensor.filter_state if sensor.is_running else _filter_start(vqf.state, sensor, samples[0])
    )
    rates = samples[:, :3]
    if params.gyr_reading != "mean":
        rates = _midway_rates(
            rates[:1] if sensor.absent or sensor.last is None else sensor.last[None, :3], rates
        )
    gyr, acc = np.ascontiguousarray(rates - sensor.bias), np.ascontiguousarray(samples[:, 3:6])
    if _has_north(sensor, samples):
        q_GS, disturbed = _filter_with_magnetometer(vqf, sensor, gyr, acc, samples[:, 6:])
    else:
        q_GS, disturbed = update_filter(vqf, gyr, acc), np.zeros(last - first, bool)
    return (
        _next_state(sensor, vqf, block.t[first:last], samples, q_GS[-1]),
        q_GS,
        disturbed & params.mag_rejection,
    )


def _filter_with_magnetometer(
    vqf: VQF, sensor: SensorState, gyr: Array, acc: Array, mag: Array
) -> tuple[Array, Bools]:
    """Orientations (n, 4) with the heading that the magnetometer keeps; where its samples are
    missing the gyroscope carries it on.

    And where its field is not the one that the filter has learnt (n,): before it has learnt one, false.
    """
    known = every(np.isfinite(mag))
    cuts = [0, *(np.flatnonzero(known[1:] != known[:-1]) + 1), len(mag)]
    pieces, disturbed, learnt = [], np.zeros(len(mag), bool), vqf.state["magRefNorm"] > 0
    for first, last in itertools.pairwise(cuts):
        if known[first]:
            fused = vqf.updateBatch(
                gyr[first:last], acc[first:last], np.ascontiguousarray(mag[first:last] * 1e6)
            )
            pieces.append(fused["quat9D"])
            disturbed[first:last] = fused["magDistDetected"] & (
                learnt | _from_first(~fused["magDistDetected"])
            )
            learnt = vqf.state["magRefNorm"] > 0
        else:
            delta = vqf.state["delta"]
            pieces.append(
                quat.turn_heading(
                    vqf.updateBatch(gyr[first:last], acc[first:last])["quat6D"], delta
                )
            )
    q_GS = np.concatenate(pieces)
    return (q_GS if sensor.north is None else quat.turn_heading(q_GS, -sensor.north)), disturbed


def _midway_rates(before: Array, gyr: Array) -> Array:
    """Rates (..., n, 3) halfway between a sample and the one before, that of the first (..., 1, 3):
    the filter turns by rate times period, and a rate at its instant would run half a period ahead
    (1.7 deg in fast tapping at 100 Hz, halfway 0.1)."""
    return np.asarray(0.5 * (gyr + np.concatenate([before, gyr[..., :-1, :]], axis=-2)))


def _filter_start(
    fresh: Mapping[str, Any], sensor: SensorState, sample: Array
) -> Mapping[str, Any]:
    """A fresh filter's state at its first sample, after a long gap with the old heading, bias and
    the new inclination."""
    if sensor.filter_state is None:
        q = (
            sensor.start
            if sensor.start is not None
            else make_upright(np.array([1.0, 0, 0, 0]), sample[3:6])
        )
        return {**fresh, "accQuat": [float(x) for x in q], "delta": sensor.north or 0.0}
    assert sensor.q_GS is not None
    preserved = {name: sensor.filter_state[name] for name in ("bias", "biasP", "delta")}
    # before the magnetometer's turn
    q_6D = quat.turn_heading(sensor.q_GS, (sensor.north or 0.0) - preserved["delta"])
    return {**fresh, **preserved, "accQuat": [float(x) for x in make_upright(q_6D, sample[3:6])]}


def make_upright(q_GS: Array, acc: Array) -> Array:
    """Turn an orientation (4,) the shortest way so that the specific force acc (3,) of a resting
    sensor points up."""
    up = quat.rotate(q_GS, acc / np.linalg.norm(acc))
    tilt = np.array([1.0 + up[2], up[1], -up[0], 0.0])
    if up[2] < -1 + 1e-12:
        tilt = np.array([0.0, 1.0, 0.0, 0.0])
    return quat.normalize(quat.multiply(quat.normalize(tilt), q_GS))
