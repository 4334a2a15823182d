"""Rows that were dropped from a file whose times do not show it: sensors jump at one instant, and gravity is elsewhere behind it, or rates step as no hand turns.

In      a block of an inertial stream of three sensors or more
Out     when rows were dropped, about how many seconds, and how probable such a jump is without a loss
Source  peaks over a threshold have exponential tails (Pickands 1975, Ann Stat 3:119): tail of the recording's own steps; use ours
Limits  streams slower than LEAST_RATE are not asked; what is lost while the hand rests is not seen, and costs nothing. A knock that all sensors feel comes back to where it began; a loss does not.
        A joint at its end stops the hand in several samples, a loss steps between two
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.sample_kernels import (
    AROUND,
    ROWS,
    add_log_ratio,
    squared_steps,
)
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

SENSORS = 3  # at least
LEAST_RATE = 40.0  # Hz: four samples of the fastest that hands move, a tremor of 10 Hz; more slowly sampled, movement steps as a loss does
FURTHEST = max(AROUND)  # rows from a jump whose steps it is measured by
NEAR = 0.25  # s between peaks that are told apart
LEAVE, TAIL = 4, 30  # largest peaks that may be losses, and peaks that tell the tail
KNOCK = 0.05  # s beside a jump that are left out of that
BESIDE = 0.4  # s before and behind a jump in which gravity is averaged
TURNED = 0.9  # share of all instants at which gravity's change has to be smaller than at a loss
LEAST_TURN = np.radians(3.0)  # of gravity in the sensors: a loss that costs less is left alone
FARTHER = 1.5  # times what SENSORS sensors do anywhere else, that they have to at a loss where the others rest
LONGEST = 10.0  # s
# times the largest step of a gyroscope beside it, up to so many rows away, that a quarter of the sensors have to step at a loss; a stop at a joint's end reaches 1.2
SHARP, NEXT = 1.5, 3
# the same of SENSORS sensors from which on rates tell by themselves: of 185 intact recordings of two simulators the largest was 1.5, of 16 sensors on a walking body (qmt) 1.7, of a board that was
# tapped and thrown about (BROAD) 5.7 in any one sensor; of rows that were dropped two thirds are larger
SURELY, STEPS_RATE = 6.0, 80.0  # Hz: more slowly sampled, brisk fingers step, too
RARE = 1e-4  # probability that is told of it: fewer intact recordings were looked at than it claims to be among
# rad/s of a step; of a sensor that moves
LEAST_STEP, MOVES = 0.15, 0.3
LEAST_STOP, LEVER = (
    0.3,
    0.01,
)  # m/s^2; m from its joint that a sensor is at least: what stops in one sample is seen to be stopped


@dataclass(frozen=True)
class Loss:
    """One place in a file where rows are missing."""

    t: float  # s, of the last row before
    seconds: float  # very roughly: what the sensors would take for the turn at the rates before and behind, LONGEST at most
    p_value: float


@dataclass(frozen=True)
class _Turns:
    """By how much gravity has turned at a row, of all sensors (rad)."""

    median: float
    few: float  # of the SENSORS-th largest
    seconds: float  # that the sensors' rates take for it


def lost_rows(blocks: Sequence[Block]) -> list[Suspicion]:
    """Places where rows were dropped without a trace in the times.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        `file.lost_rows`, one a place and stream.
    """
    found = []
    for block in blocks:
        for loss in losses_of(block) if block.stream.inertial else ():
            values = {"seconds": loss.seconds, "at": loss.t}
            span = (loss.t, loss.t)
            found.append(
                Suspicion(
                    Message("file.lost_rows", values, "fault"),
                    block.stream.sensors,
                    (span,),
                    loss.p_value,
                )
            )
    return found


def losses_of(block: Block) -> list[Loss]:
    """Losses in one stream, in order of time."""
    if len(block.stream.sensors) < SENSORS or len(block.t) < 4 * FURTHEST:
        return []
    period = float(np.median(np.diff(block.t)))
    if period > 1.0 / LEAST_RATE:
        return []
    jump = _jumps(block)
    stepping = _unlike_movement(block, period)
    peaks = _peaks(jump, max(1, round(NEAR / period)))
    if len(peaks) < LEAVE + 5:
        return stepping
    tail = jump[peaks[LEAVE : LEAVE + TAIL]]
    begin, slope = float(tail[-1]), max(float((tail - tail[-1])[:-1].mean()), 0.2)
    found = []
    for k in peaks[:LEAVE]:
        p = float(min(1.0, len(tail) * np.exp(-(jump[k] - begin) / slope)))
        if p < FALSE_ALARMS and _is_sharp(block, int(k)):
            turns = _turns_at(block, int(k), period)
            if turns is not None and _is_elsewhere(turns, _usual_turns(block, int(k), period)):
                found.append(Loss(float(block.t[k]), turns.seconds, p))
    found += [s for s in stepping if all(abs(s.t - f.t) > NEAR for f in found)]
    return sorted(found, key=lambda loss: loss.t)


def _unlike_movement(block: Block, period: float) -> list[Loss]:
    """Losses that rates alone show: in SENSORS sensors, and most of those that move, they step between two samples, and no acceleration is there that would stop a hand so."""
    if period > 1.0 / STEPS_RATE:
        return []
    gyr, step, sharp = block.of(GYR), *_sharpness(block.of(GYR))
    changes = _around(np.linalg.norm(np.diff(block.of(ACC), axis=0), axis=-1))
    beside = np.maximum(changes[NEXT - 1], changes[NEXT + 1])
    usual = reduce(np.maximum, [*changes[: NEXT - 1], *changes[NEXT + 2 :]])
    stopped = beside - usual > np.maximum(LEAST_STOP, LEVER * step / period)
    with np.errstate(invalid="ignore"):
        steps = np.where((step > LEAST_STEP) & ~stopped, sharp, 0.0)
        fast = np.linalg.norm(gyr - np.nanmedian(gyr, axis=0), axis=-1) > MOVES
    rows = np.arange(len(steps)) + NEXT
    moving = fast[rows] | fast[rows + 1]
    most = (moving & (sharp > SHARP)).sum(axis=1) >= 0.5 * moving.sum(axis=1)
    regular = np.lib.stride_tricks.sliding_window_view(np.diff(block.t), 2 * NEXT + 1).max(axis=1)
    few = np.sort(steps, axis=1)[:, -SENSORS]
    few = np.where(most & (regular < 1.5 * period), few, 0.0)
    found = []
    for k in _peaks(few, max(1, round(NEAR / period)))[:LEAVE]:
        turns = _turns_at(block, int(rows[k]), period) if few[k] > SURELY else None
        if turns is not None:
            found.append(Loss(float(block.t[rows[k]]), turns.seconds, RARE))
    return found


def _sharpness(rates: Array) -> tuple[Array, Array]:
    """How far rates (n, S, 3) step (n - 2 NEXT - 1, S) from row NEXT on to the next, and how many times the largest step within NEXT rows; 0 where one is missing."""
    steps = _around(np.linalg.norm(np.diff(rates, axis=0), axis=-1))
    step, beside = steps[NEXT], reduce(np.maximum, [*steps[:NEXT], *steps[NEXT + 1 :]])
    return np.nan_to_num(step), np.nan_to_num(step / np.maximum(beside, 1e-9))


def _around(steps: Array) -> list[Array]:
    """Steps (n, S) within NEXT rows before and behind each, one view (n - 2 NEXT, S) a row."""
    count = max(len(steps) - 2 * NEXT, 0)
    return [steps[k : k + count] for k in range(2 * NEXT + 1)]


def _jumps(block: Block) -> Array:
    """How far beyond its usual steps the median sensor steps behind each row (n,), logarithm; -inf where rows are missing anyhow."""
    out, dt = np.full(len(block.t), -np.inf), np.diff(block.t)
    total = np.zeros((len(block.t) - ROWS + 1, len(block.stream.sensors)))
    for quantity in (GYR, ACC):
        add_log_ratio(squared_steps(np.ascontiguousarray(block.of(quantity))), total)
    total = np.where(np.isfinite(total), total, -np.inf)
    jump = np.sort(total, axis=1)[:, (total.shape[1] - 1) // 2]
    regular = np.lib.stride_tricks.sliding_window_view(dt, 5).max(axis=1) < 1.5 * np.median(dt)
    out[2:-3] = np.where(regular, jump, -np.inf)
    return out


def _peaks(jump: Array, spacing: int) -> NDArray[np.intp]:
    """Rows of largest jumps, largest first, none nearer to a larger one than `spacing` rows."""
    padded = np.pad(jump, spacing, constant_values=-np.inf)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * spacing + 1).max(axis=1)
    rows = np.flatnonzero((jump == largest) & np.isfinite(jump))
    return np.asarray(rows[np.argsort(-jump[rows])])


def _is_elsewhere(turns: _Turns, usual: Sequence[_Turns]) -> bool:
    """Whether gravity is elsewhere behind a row: in most sensors, or far more than ever else in those of the fingers that move."""
    if not usual:
        return False
    most = max(LEAST_TURN, float(np.quantile([u.median for u in usual], TURNED)))
    few = max(LEAST_TURN, FARTHER * max(u.few for u in usual))
    return bool(turns.median > most or turns.few > few)


def _is_sharp(block: Block, row: int) -> bool:
    """Whether rates step between two samples near a row, rather than in the course of several."""
    rates = block.of(GYR)[max(row - NEXT - 2, 0) : row + NEXT + 4]
    return bool(np.any(np.quantile(_sharpness(rates)[1], 0.75, axis=1) > SHARP))


def _usual_turns(block: Block, row: int, period: float) -> list[_Turns]:
    """How gravity turns elsewhere than at a row."""
    n = _rows_beside(1.0 / period)
    places = np.linspace(n, len(block.t) - n - 1, 60).astype(int)
    far = (int(k) for k in places if abs(k - row) > 2 * n)
    return [turns for k in far if (turns := _turns_at(block, k, period)) is not None]


def _rows_beside(rate: float) -> int:
    return max(3, round(BESIDE * rate))


def _turns_at(block: Block, row: int, period: float) -> _Turns | None:
    """Turns of gravity from before a row to behind it in the frame there, and the time that the rates there take for them."""
    rate = 1.0 / period
    n = _rows_beside(rate)
    rows = slice(row - n + 1, row + n + 1)
    gyr, acc = block.of(GYR)[rows], block.of(ACC)[rows]
    if row - n + 1 < 0 or len(gyr) < 2 * n:
        return None
    whole = np.isfinite(gyr).all(axis=(0, 2)) & np.isfinite(acc).all(axis=(0, 2))
    if whole.sum() < SENSORS:
        return None
    gyr, acc = gyr[:, whole], acc[:, whole]
    before, behind = (
        _carried(gyr[n - 1 :: -1], acc[n - 1 :: -1], -1 / rate),
        _carried(gyr[n:], acc[n:], 1 / rate),
    )
    turn = np.arccos(np.clip((before * behind).sum(axis=-1), -1, 1))
    rates = 0.5 * (gyr[n - 3 : n].mean(axis=0) + gyr[n : n + 3].mean(axis=0))
    speed = np.linalg.norm(np.cross(rates, before), axis=-1)
    seconds = min(LONGEST, float((turn * speed).sum()) / max(float((speed**2).sum()), 1e-9))
    return _Turns(float(np.median(turn)), float(np.sort(turn)[-SENSORS]), seconds)


def _carried(gyr: Array, acc: Array, dt: float) -> Array:
    """Direction (S, 3) of the mean of forces (n, S, 3), but those of a knock, brought to the first row's frame by rates."""
    q, total = np.broadcast_to(quat.IDENTITY, (*gyr.shape[1:-1], 4)), np.zeros(acc.shape[1:])
    for k, (w, a) in enumerate(zip(gyr, acc)):
        q = quat.multiply(q, quat.exp(0.5 * dt * w))
        if k >= round(KNOCK / abs(dt)):
            total = total + quat.rotate(q, a)
        q = quat.multiply(q, quat.exp(0.5 * dt * w))
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-9))
