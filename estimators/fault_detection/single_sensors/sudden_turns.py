"""A sensor that sits otherwise from one sample to the next: without its gyroscope seeing it turn, where it slipped as samples were lost, or readings were joined; or by a turn
that its gyroscope sees in a sample or two, which no segment makes.

In      a block of an inertial stream
Out     which sensor, by what turn, when, and how probable such a step is without one; readings of a gyroscope that stand alone
Source  one rotation explains the step of both triads; peaks over a threshold have exponential tails (Pickands 1975, Ann Stat 3:119): tail of the recording's own steps
Limits  streams slower than LEAST_RATE are not asked; a turn about the vertical moves no gravity and is left alone; a turn that takes longer than a sample is seen by the gyroscope: neighbours/slips.py, finger_ekf/mounting_change.py
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.sample_kernels import (
    ROWS,
    explained_steps,
)
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

LEAST, MOST = np.radians([6.0, 60.0])  # smaller turns are those of skin, larger ones no slip
LEAST_RATE = 25.0  # Hz: four samples on either side of a step
SPACING = 0.1  # s between peaks
LEAVE, TAIL = 4, 40  # largest peaks that may be slips, and peaks that show the tail
SLOPE = (
    0.3  # least slope of the tail, that of the root of chi square with 3 degrees of freedom far out
)
EXPECTED_REST = 9.0  # of a step that a rotation makes: three times its degrees of freedom
LEAST_SURE = 0.05  # probability from which on a step is not looked at
BESIDE = (
    0.15,
    0.3,
)  # s before and behind a step, along which the course of the force is fitted: what fits better elsewhere
KNOCK = 0.05  # s behind a step that are left out of it
DEGREE = 3  # of the course, a polynomial
ACROSS = 0.2  # sine of the least angle between a turn's axis and the force: a kink of rates looks like a large turn about the vertical
# m/s^2, m: what a course leaves, and how far a sensor lies from where its segment turns about
COURSE_SD, ARM_SD = 0.2, 0.05
# of which a turn may leave one at most: a share of a lasting step, standard deviations
MENDED, CLEAR = 0.5, 3.0
ALONE = 1e-12  # probability of the step from which on gravity need not tell: keys that are struck hard reach 1e-8
# of what no rotation explains of a step, of which a joint that is stopped leaves more: variances, and shares of the step
EXACT_REST, EXACT, OF_STEP = 12.0, 0.003, 0.1
SEVERAL = 3  # sensors that step at once: rows are lost, or the hand is stopped; no sensor slipped
AS_MUCH = 0.5  # of a sensor's step, from which on another's counts as one
AT_ONCE = 0.1  # s
# by samples that a turn takes which its gyroscope sees: s between samples at most; at lower rates a flick of 0.05 s looks so
WIDTHS = {1: 0.0175, 2: 0.0105}
ISOLATED, ASIDE = 5.0, 8  # times the largest such turn within so many samples on either side
RETURNED = 0.3  # of the excess: behind it the rate is what it was before; that of a finger that hits something is not
SMALLEST = 1e-100  # probability; its logarithm has to be finite
NO_GAP = 1.5  # usual intervals between the samples next to a step: none is missing
LONGEST_STEP = 2.5  # usual intervals between samples; behind a longer gap the movement itself has turned the sensor


@dataclass(frozen=True)
class SuddenTurn:
    """One sensor at one instant."""

    sensor: str
    t: float  # s, of the first sample behind
    turn: Array  # (3,) rad, takes vectors of the later frame to the earlier one
    p_value: float


def sudden_turns(blocks: Sequence[Block]) -> list[Suspicion]:
    """Sensors that were turned from one sample to the next.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        `sensor.slipped`, one a sensor, each with its correction as those of neighbours/.
    """
    found = []
    for block in blocks:
        for slip in turns_of(block) if block.stream.inertial else ():
            values: dict[str, float | str] = {
                "sensor": slip.sensor,
                "angle_deg": float(np.degrees(np.linalg.norm(slip.turn))),
                "start": slip.t,
            }
            message = Message("sensor.slipped", values, "warning")
            correction = {"turn": quat.exp(slip.turn), "start": slip.t}
            span = (slip.t, float(block.t[-1]))
            found.append(Suspicion(message, (slip.sensor,), (span,), slip.p_value, correction))
    return found


def spikes(blocks: Sequence[Block]) -> list[Suspicion]:
    """Gyroscopes that read a turn in a sample or two that no finger makes: the sensor slipped, or the reading is wrong.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        `sensor.spike`, one a sensor; certain.
    """
    found = []
    for block in blocks:
        for k, sensor in enumerate(block.stream.sensors if block.stream.inertial else ()):
            turns = _spikes_of(block.t, block.of(GYR)[:, k])
            if turns:
                largest = max(turns, key=lambda turn: turn[1])
                values: dict[str, float | str] = {
                    "sensor": sensor,
                    "angle_deg": float(np.degrees(largest[1])),
                    "start": largest[0],
                    "count": float(len(turns)),
                }
                span = (min(t for t, _ in turns), float(block.t[-1]))
                message = Message("sensor.spike", values, "fault")
                found.append(Suspicion(message, (sensor,), (span,), 0.0))
    return found


def _spikes_of(t: Array, rate: Array) -> list[tuple[float, float]]:
    """When (s) and by what angle (rad) a gyroscope's readings (n, 3) turn beyond what those beside them do."""
    rows = np.flatnonzero(np.isfinite(rate).all(axis=1))
    if len(rows) < 4 * ASIDE:
        return []
    t, rate = t[rows], rate[rows]
    usual = float(np.median(np.diff(t)))
    found: dict[int, float] = {}
    for width in (w for w, longest in WIDTHS.items() if usual <= longest):
        before, behind = rate[: -width - 1], rate[width + 1 :]
        inner = np.lib.stride_tricks.sliding_window_view(rate[1:-1], width, axis=0).sum(axis=2)
        excess = np.linalg.norm(inner - 0.5 * width * (before + behind), axis=1)
        returns = np.linalg.norm(behind - before, axis=1) < RETURNED * excess
        steps = np.lib.stride_tricks.sliding_window_view(np.diff(t), width + 1)
        whole = steps.max(axis=1) < NO_GAP * usual
        for k in np.flatnonzero((excess * usual > LEAST) & returns & whole).tolist():
            near = np.arange(max(0, k - ASIDE), min(len(excess), k + ASIDE + 1))
            others = excess[near[np.abs(near - k) > width]]
            if excess[k] > ISOLATED * others.max():
                at = k + 1
                if not any(abs(at - other) <= width for other in found):
                    found[at] = float(excess[k] * usual)
    return [(float(t[k]), angle) for k, angle in found.items()]


def turns_of(block: Block) -> list[SuddenTurn]:
    """Sudden turns in one stream, the most certain one of each sensor."""
    candidates: dict[str, SuddenTurn] = {}
    for k, sensor in enumerate(block.stream.sensors):
        for turn in _of_sensor(block, k):
            if sensor not in candidates or turn.p_value < candidates[sensor].p_value:
                candidates[sensor] = turn
    every = list(candidates.values())
    alone = [s for s in every if sum(abs(s.t - o.t) < AT_ONCE for o in every) < SEVERAL]
    return [s for s in alone if _stepping(block, s) < SEVERAL]


def _stepping(block: Block, turn: SuddenTurn) -> int:
    """How many sensors' forces step when a sensor is said to have turned, about as much as its own."""
    own = block.stream.sensors.index(turn.sensor)
    sizes = np.array([_step_size(block, k, turn.t) for k in range(len(block.stream.sensors))])
    return int(np.count_nonzero(sizes > AS_MUCH * sizes[own]))


def _step_size(block: Block, column: int, t: float) -> float:
    """The largest step of a sensor's force between two of the rows next to an instant, m/s^2, beside its course; 0 where rows are missing."""
    acc, half = block.of(ACC)[:, column], ROWS // 2
    rows = np.flatnonzero(np.isfinite(acc).all(axis=1))
    at = int(np.searchsorted(block.t[rows], t))
    starts = [k - half for k in (at - 1, at, at + 1) if half <= k <= len(rows) - half]
    sizes = [0.0]
    for k in starts:
        y, when = acc[rows[k : k + ROWS]], block.t[rows[k : k + ROWS]]
        before, behind = y[:half], y[half:]
        slope = (before[-1] - before[0]) / (when[half - 1] - when[0])
        slope = slope + (behind[-1] - behind[0]) / (when[-1] - when[half])
        course = 0.5 * slope * (when[half + 1] - when[1])
        sizes.append(float(np.linalg.norm(np.median(behind, 0) - np.median(before, 0) - course)))
    return max(sizes)


def _of_sensor(block: Block, column: int) -> Iterator[SuddenTurn]:
    values = np.concatenate([block.of(GYR)[:, column], block.of(ACC)[:, column]], axis=1)
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(rows) < 4 * (LEAVE + TAIL):
        return
    t, values = block.t[rows], np.ascontiguousarray(values[rows])
    usual = float(np.median(np.diff(t)))
    if usual > 1.0 / LEAST_RATE:
        return
    explained, rest, turn = explained_steps(t, values)
    size = np.sqrt(explained / (1.0 + rest / EXPECTED_REST))
    gap = np.lib.stride_tricks.sliding_window_view(np.diff(t), ROWS - 1) / usual
    size[(gap > LONGEST_STEP).any(axis=1) | (gap[:, 1:-1] > NO_GAP).any(axis=1)] = 0.0
    peaks = _peaks(size, max(1, round(SPACING / usual)))
    usual_ones = peaks[LEAVE : LEAVE + TAIL]
    if len(usual_ones) < 5:
        return
    tail, among = size[usual_ones], len(block.stream.sensors)
    slope = max(float((tail - tail[-1])[:-1].mean()), SLOPE)
    for k in peaks[:LEAVE]:
        p_step = float(min(1.0, among * len(tail) * np.exp(-(size[k] - tail[-1]) / slope)))
        most = min(OF_STEP * explained[k], EXACT_REST + EXACT * explained[k])
        fits = rest[k] < most and LEAST < np.linalg.norm(turn[k]) < MOST
        if not fits or p_step > LEAST_SURE:
            continue
        row, places = k + ROWS // 2, np.array([k, *usual_ones]) + ROWS // 2
        lasting, n = min(
            (
                (_lasting_step(t, values, places, n, usual), n)
                for n in (round(s / usual) for s in BESIDE)
            ),
            key=lambda steps: float((steps[0][1:] ** 2).sum()),
        )
        mended = _lasting_step(t, _turned_back(values, row, turn[k]), places[:1], n, usual)
        force = 0.5 * (values[row - 1, 3:] + values[row, 3:])
        expected = np.cross(force, turn[k])
        if np.linalg.norm(expected) < ACROSS * np.linalg.norm(turn[k]) * np.linalg.norm(force):
            continue
        p_gravity = _p_without(lasting, mended[0], expected)
        if p_gravity is None or (p_gravity == 1.0 and p_step > ALONE):
            continue
        p = _of_both(p_step, p_gravity)
        if p < FALSE_ALARMS:
            yield SuddenTurn(block.stream.sensors[column], float(t[row]), turn[k], p)


def _turned_back(values: Array, row: int, turn: Array) -> Array:
    """Rates and forces (n, 6), those from a row on turned."""
    later = quat.rotate(quat.exp(turn), values[row:].reshape(-1, 2, 3))
    return np.concatenate([values[:row], later.reshape(-1, 6)])


def _p_without(seen: Array, mended: Array, expected: Array) -> float | None:
    """Probability of a lasting step (the first of `seen`) that a turn explains so well, which leaves `mended` of it, without one: no less than one in the places it is compared with.

    None where the readings fit better without the turn, or where it explains too little of the step; 1 where a hand accelerates too hard to tell what it should make of gravity, `expected`.
    """
    sd, size = float(np.sqrt((seen[1:] ** 2).mean())), float(np.linalg.norm(expected))
    gained = float(seen[0] @ seen[0] - mended @ mended)
    if sd > size:
        return 1.0
    if gained < 0.0:
        return None
    left = float(np.linalg.norm(mended))
    if left > max(MENDED * float(np.linalg.norm(seen[0])), CLEAR * sd):
        return None
    return max(float(normal_sf((gained + size**2) / (2 * size * sd))), 1.0 / len(seen))


def _of_both(p: float, q: float) -> float:
    """Probability of two independent findings together. (Fisher 1925, Statistical Methods for Research Workers, 21.1)"""
    product = max(p * q, SMALLEST)
    return product * (1.0 - float(np.log(product)))


def _peaks(size: Array, spacing: int) -> NDArray[np.intp]:
    """Rows of largest steps, largest first, none nearer to a larger one than `spacing` rows."""
    padded = np.pad(size, spacing, constant_values=-np.inf)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * spacing + 1).max(axis=1)
    rows = np.flatnonzero((size == largest) & (size > 0.0))
    return np.asarray(rows[np.argsort(-size[rows])])


def _lasting_step(t: Array, values: Array, rows: NDArray[np.intp], n: int, usual: float) -> Array:
    """By how much (places, 3) m/s^2 the specific force is another behind rows than its course up to there, in the frame of the row before each; a knock is over by then.

    The course is a polynomial, and what the sensor's turning adds at its place on the segment, which is fitted: in that time a finger that taps turns to and fro.
    """
    over = round(KNOCK / usual)
    rows = np.clip(rows, n + 1, len(t) - n)[:, None] - 1
    before, behind = (_carried(t, values, rows + k) for k in (-np.arange(n), np.arange(n + 1)))
    force, arm = (
        np.concatenate([b[:, ::-1], h[:, 1 + over :]], axis=1) for b, h in zip(before, behind)
    )
    at = np.concatenate([np.arange(-n, 0), np.arange(over, n)]) / n
    terms = np.concatenate([at[:, None] ** np.arange(DEGREE + 1), (at >= 0)[:, None]], axis=1)
    solved = np.linalg.pinv(terms)
    rest = np.eye(len(at)) - terms @ solved  # what no such course has
    own = np.einsum("mn,pnij->pmij", rest, arm)
    normal = np.einsum("pnij,pnik->pjk", own, own) + (COURSE_SD / ARM_SD) ** 2 * np.eye(3)
    right = np.einsum("pnij,pni->pj", own, force)
    place = np.linalg.solve(normal, right[..., None])[..., 0]
    course = force - np.einsum("pnij,pj->pni", arm, place)
    return np.asarray(np.einsum("n,pni->pi", solved[-1], course))


def _carried(t: Array, values: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """Specific forces (places, n, 3) in rows, and what an arm of 1 m along each axis adds to them (places, n, 3, 3), in the frame of the first row of each place."""
    gyr, at = values[rows, :3], t[rows]
    turn = 0.5 * (gyr[:, 1:] + gyr[:, :-1]) * np.diff(at, axis=1)[..., None]
    q = np.broadcast_to(quat.IDENTITY, (*rows.shape, 4)).copy()
    for k, step in enumerate(np.moveaxis(quat.exp(turn), 1, 0), 1):
        q[:, k] = quat.multiply(q[:, k - 1], step)
    slope = (gyr[:, 2:] - gyr[:, :-2]) / (at[:, 2:] - at[:, :-2])[..., None]
    change = np.concatenate([slope[:, :1], slope, slope[:, -1:]], axis=1)
    square = (gyr**2).sum(axis=-1)[..., None, None] * np.eye(3)
    arm = gyr[..., :, None] * gyr[..., None, :] - square + quat.skew(change)
    return quat.rotate(q, values[rows, 3:]), quat.matrix(q) @ arm
