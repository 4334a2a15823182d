"""Orientations that a device's own fusion gives, as methods take them.

In      streams of unit quaternions q_ES: each sensor in a frame E of its own, z up, any heading
Out     the same streams with the angular rates and the gravity that the orientations imply, for
        poses and mounting; q_GS, turned about the vertical as the pose demands
Source  Salchow-Hoemmen 2019, 2.4.2 (headings against the hand in the initial pose); the rest ours
Limits  what the device's fusion gets wrong stays; a device that sets its heading anew in between
        spoils everything until the next pose
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import (
    ACC,
    GYR,
    ORIENTATION,
    Block,
    Recording,
    RecordingView,
    Stream,
)
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion_state import Oriented
from handscope.estimators.sensors.missing_samples import insert_missing_instants

Z = 2  # axis
DERIVED = (GYR, ACC, ORIENTATION)
UNIT_NORM = 0.1  # by which a quaternion's norm may be off; what is further off is no orientation
HELD, NEVER_KNOWN = np.uint8(Flag.MISSING), np.uint8(Flag.UNCALIBRATED)


def derived_stream(stream: Stream) -> Stream:
    """The stream with what its orientations imply; another stream is itself."""
    return replace(stream, quantities=DERIVED) if stream.oriented else stream


def derive(block: Block, previous: Block | None = None) -> Block:
    """Add the mean angular rate since the sample before (rad/s, zero for the first of all) and the
    specific force at rest (m/s^2) that orientations imply; `previous` ends with the sample before.
    """
    q_ES = unit_or_missing(block.of(ORIENTATION))
    before = None if previous is None or not len(previous.t) else previous
    first = q_ES[:1] if before is None else unit_or_missing(before.of(ORIENTATION)[-1:])
    t_first = block.t[:1] if before is None else before.t[-1:]
    dt = np.diff(np.concatenate([t_first, block.t]))[:, None, None]
    turned = quat.log(quat.relative(np.concatenate([first, q_ES])[:-1], q_ES))
    gyr = np.divide(turned, dt, out=np.zeros_like(turned), where=dt > 0)
    acc = GRAVITY * quat.rotate(quat.conjugate(q_ES), np.array([0.0, 0.0, 1.0]))
    values = np.concatenate([gyr, acc, q_ES], axis=-1)
    return Block(derived_stream(block.stream), block.t, values)


def unit_or_missing(q: Array) -> Array:
    """Quaternions (..., 4) normalised; NaN where the norm says that it is none."""
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(norm - 1.0) <= UNIT_NORM, q / norm, np.nan)


@dataclass(frozen=True, kw_only=True)
class GivenParams:
    """Options of orientations that a device gives."""

    orientation_sd: float = option(
        0.0,
        "deg",
        "standard deviation of an orientation that a device computed, as its maker states it; 0: as "
        "repeated poses show it",
        "the device's data sheet",
        least=0.0,
        most=45.0,
    )


def with_orientations(takes: bool, recording: Recording) -> Recording:
    """The recording for a method that `takes` orientations or does not: InputError where it
    needs rates and there are none."""
    if not any(s.oriented for s in recording.streams):
        return recording
    if takes:
        return WithDerivedRates(recording)
    require_rates(recording.streams)
    return recording


def require_rates(streams: Sequence[Stream]) -> None:
    """InputError where sensors bring orientations and nothing else."""
    if any(s.oriented for s in streams) and not any(s.inertial for s in streams):
        raise InputError("orientation.rates_missing")


class LiveRates:
    """What orientations imply, block by block as a device sends them."""

    def __init__(self) -> None:
        self._previous: dict[str, Block] = {}
        self._raw: frozenset[str] = frozenset()  # sensors that send raw samples

    def derive(self, block: Block) -> Block | None:
        """The block as methods take it; None where our own fusion serves its sensors."""
        if block.stream.inertial:
            self._raw |= set(block.stream.sensors)
        if not block.stream.oriented:
            return block
        if self._raw & set(block.stream.sensors):
            return None
        before = self._previous.get(block.stream.name)
        same = before is not None and before.stream == block.stream
        if len(block.t):
            self._previous[block.stream.name] = Block(block.stream, block.t[-1:], block.values[-1:])
        return derive(block, before if same else None)


@dataclass(frozen=True)
class WithDerivedRates(RecordingView):
    """A recording whose streams of orientations bring what these imply, too; of sensors that have
    raw samples the orientations are left out: the fusion is then ours."""

    @property
    def streams(self) -> tuple[Stream, ...]:
        kept = ((s, _kept_columns(s, self._raw)) for s in self.recording.streams)
        return tuple(derived_stream(_with_sensors(s, k)) for s, k in kept if k)

    def blocks(self) -> Iterator[Block]:
        previous: dict[str, Block] = {}
        raw = self._raw
        for block in self.recording.blocks():
            columns = _kept_columns(block.stream, raw)
            if not block.stream.oriented:
                yield block
            elif columns:
                part = Block(
                    _with_sensors(block.stream, columns), block.t, block.values[:, columns]
                )
                yield derive(part, previous.get(block.stream.name))
                previous[block.stream.name] = part

    @property
    def _raw(self) -> frozenset[str]:
        return frozenset(p for s in self.recording.streams if s.inertial for p in s.sensors)


def _kept_columns(stream: Stream, raw: frozenset[str]) -> list[int]:
    """Which sensors of a stream are used (their places)."""
    return [k for k, p in enumerate(stream.sensors) if not (stream.oriented and p in raw)]


def _with_sensors(stream: Stream, columns: Sequence[int]) -> Stream:
    return replace(stream, sensors=tuple(stream.sensors[k] for k in columns))


def mean_orientations(blocks: Sequence[Block]) -> dict[str, Array]:
    """Mean q_ES (4,) by sensor over blocks of a pose."""
    found = {}
    for block in (b for b in blocks if ORIENTATION in b.stream.quantities):
        for k, name in enumerate(block.stream.sensors):
            q_ES = unit_or_missing(block.of(ORIENTATION)[:, k])
            q_ES = q_ES[np.isfinite(q_ES[:, 0])]
            if len(q_ES):
                found[name] = quat.mean(q_ES)
    return found


@dataclass(frozen=True)
class State:
    """One stream: how its sensors' frames are turned to ours, and the newest orientations."""

    stream: Stream
    q_GE: Array  # (sensors, 4) a turn about the vertical
    flags: NDArray[np.uint8]  # (sensors,) of unknown headings
    q_GS: Array  # (sensors, 4) newest, NaN before the first
    period: float  # s
    t: float = -np.inf


def start(
    stream: Stream, calibration: Calibration, common_heading: bool, rate: float | None
) -> State:
    """Begin at a calibration; with `common_heading` the device's headings are taken as they are
    where no pose says otherwise."""
    q_GE = np.tile(quat.IDENTITY, (len(stream.sensors), 1))
    flags = np.zeros(len(stream.sensors), np.uint8)
    for k, name in enumerate(stream.sensors):
        if name in calibration.q_GS and name in calibration.q_ES:
            q_GE[k] = heading_turn(calibration.q_GS[name], calibration.q_ES[name])
        elif not common_heading:
            flags[k] = NEVER_KNOWN
    held = np.full((len(stream.sensors), 4), np.nan)
    return State(stream, q_GE, flags, held, 1.0 / (rate or stream.rate))


def step(max_gap: float, state: State, block: Block) -> tuple[State, Oriented]:
    """Turn one block of a derived stream; a sample that is missing is the one before, flagged."""
    block, sampled = insert_missing_instants(block, state.t, state.period, max_gap)
    q_GS = quat.multiply(state.q_GE, unit_or_missing(block.of(ORIENTATION)))
    whole = np.isfinite(q_GS[..., 0])
    flags = np.where(whole, 0, HELD).astype(np.uint8) | state.flags
    q_GS = _hold(state.q_GS, q_GS, whole)
    newest = float(block.t[-1]) if len(block.t) else state.t
    held = q_GS[-1] if len(block.t) else state.q_GS
    variance = np.zeros(whole.shape)
    return replace(state, q_GS=held, t=newest), Oriented(block.t, q_GS, flags, variance, sampled)


def _hold(before: Array, q_GS: Array, whole: NDArray[np.bool_]) -> Array:
    """The newest orientation at or before each row (n, sensors, 4)."""
    if whole.all():
        return q_GS
    rows = np.where(whole, np.arange(1, len(q_GS) + 1)[:, None], 0)
    newest = np.maximum.accumulate(rows, axis=0)
    return np.asarray(np.concatenate([before[None], q_GS])[newest, np.arange(q_GS.shape[1])])


def rate_orientations(
    params: GivenParams, calibrations: Sequence[Calibration]
) -> tuple[list[Calibration], list[str]]:
    """The calibrations with how good the device's orientations are, and a sentence that says whose
    fusion it was and what its error bars rest on."""
    given = sorted({name for c in calibrations for name in c.q_ES})
    if not given:
        return list(calibrations), []
    stated = np.radians(params.orientation_sd) if params.orientation_sd > 0 else None
    sd = stated if stated is not None else _repeated_sd(calibrations)
    count = len(given)
    if stated is not None:
        sentence = phrase("orientation.stated_accuracy", count=count, size=params.orientation_sd)
    elif sd is not None:
        sentence = phrase(
            "orientation.from_poses", count=count, poses=len(calibrations), size=np.degrees(sd)
        )
    else:
        sentence = phrase("orientation.no_accuracy", count=count)
    return [replace(c, orientation_sd=sd) for c in calibrations], [sentence]


def _repeated_sd(calibrations: Sequence[Calibration]) -> float | None:
    """Standard deviation (rad) of one axis of one sensor's orientation, as later poses differ from
    the first; None where the pose was not repeated. It holds how well the pose was repeated, too.
    """
    posed = [c for c in calibrations if "hand" in c.q_ES and "hand" in c.q_GS]
    if not posed:
        return None
    first, *later = posed
    changes = [
        quat.log(quat.relative(_on_hand(first, first, name), _on_hand(first, c, name)))
        for c in later
        for name in first.q_ES.keys() & c.q_ES.keys() - {"hand"}
    ]
    if not changes:
        return None
    return float(np.sqrt(np.mean(np.square(changes)) / 4))  # two sensors, each in two poses


def _on_hand(first: Calibration, pose: Calibration, name: str) -> Array:
    """A sensor's orientation (4,) against the hand's in a pose, headings those of the first."""
    q_hand, q_sensor = (
        quat.multiply(heading_turn(first.q_GS[n], first.q_ES[n]), pose.q_ES[n])
        for n in ("hand", name)
    )
    return quat.relative(q_hand, q_sensor)


def heading_turn(q_GS: Array, q_ES: Array) -> Array:
    """The turn q_GE (4,) about the vertical that takes an orientation nearest to ours."""
    return quat.about(Z, quat.twist(quat.multiply(q_GS, quat.conjugate(q_ES)), Z))
