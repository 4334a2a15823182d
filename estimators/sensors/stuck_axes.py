"""Which axes of which sensors stand still, second by second: a living sensor's noise changes every
axis.

In      samples of all streams, one block each
Out     Findings: dead axes, sensors and magnetometers that give one reading
Source  ours. An axis is dead where the covariance of the steps from sample to sample has no extent
        in some direction; after a strip's correction that direction is no longer quite the axis, so
        the covariance is looked at and not the axis
Limits  noiseless data (a simulation) has no such mark: where in some second nearly everything
        stands still, or most of the other fingers' sensors do, there is no finding; nor
        while nothing moves
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import ACC, GYR, MAG, Block
from handscope.estimators.messages import Value
from handscope.estimators.messages.sentence import messages_of, phrase
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.jit import Compiled, rowwise
from handscope.estimators.numerics.typing import Array, Bools, Indices

WINDOW = 1.0  # s
# rad/s, m/s^2, T: far below a count of any sensor, far above rounding
STILL = {
    GYR: 1e-6,
    ACC: 1e-5,
    MAG: 1e-11,
}
NOISELESS = 0.95  # share of all directions that stand still in some second
OTHERS = 0.8  # share of the other sensors' directions that must change meanwhile
MOVES = 0.2  # rad/s, root mean square of the angular rate in a second of movement
WORDS = {
    GYR: phrase("quantity.gyroscope"),
    ACC: phrase("quantity.accelerometer"),
    MAG: phrase("quantity.magnetometer"),
}
BOTH = phrase("quantity.gyroscope_and_accelerometer")
CHECK = phrase("fault.check_plug")


@dataclass(frozen=True)
class _AxisExtents:
    """One quantity of one sensor, second by second."""

    dead: Bools  # (seconds, 3) directions without extent, least first
    axis: Indices  # (seconds, 3) the sensor axis nearest to each direction
    known: Bools  # (seconds,) whether there were samples


def check(blocks: Sequence[Block]) -> list[Finding]:
    """All that stands still although it should not."""
    spans = [(b.t[0], b.t[-1]) for b in blocks if len(b.t)]
    edges = np.arange(
        min((s for s, _ in spans), default=0.0),
        max((e for _, e in spans), default=0.0) + WINDOW,
        WINDOW,
    )
    if len(edges) < 2:
        return []
    seen = {
        (s, q): own
        for b in blocks
        for q in b.stream.quantities
        if q in WORDS
        for s, own in zip(b.stream.sensors, _measure_extents(b, q, edges))
    }
    moves = {
        s: moved
        for b in blocks
        if GYR in b.stream.quantities
        for s, moved in zip(b.stream.sensors, _moving_seconds(b, edges).T)
    }
    inertial = [s for (_, q), s in seen.items() if q != MAG]
    if (
        not inertial
        or _share([s.dead for s in inertial], [s.known for s in inertial]).max() >= NOISELESS
    ):
        return []
    found = []
    for (sensor, quantity), own in seen.items():
        if own.dead.any():
            others = _others_move(sensor, quantity, seen)
            near = [
                m
                for s, m in moves.items()
                if sensor in ("hand", "forearm") or _finger(s) == _finger(sensor)
            ]
            moved = np.any(near, axis=0) if near else np.ones(len(edges) - 1, bool)
            found += _standing_findings(sensor, quantity, own, others, moved, edges)
    return _merge(found)


def _measure_extents(block: Block, quantity: str, edges: Array) -> list[_AxisExtents]:
    """Extent of every sensor's steps from sample to sample in each second."""
    first = np.searchsorted(block.t, edges)
    covariance = _by_second(_step_covariance, block, quantity, first, (3, 3))
    enough = np.diff(first) >= max(3.0, 0.5 * WINDOW * block.stream.rate)
    known = enough[:, None] & np.isfinite(covariance).all(axis=(-2, -1))
    covariance[~known] = 0.0
    suspect = known & (
        np.linalg.det(covariance)
        <= STILL[quantity] ** 2 * np.trace(covariance, axis1=-2, axis2=-1) ** 2
    )
    dead, axis = np.zeros((*known.shape, 3), bool), np.zeros((*known.shape, 3), np.intp)
    if suspect.any():
        extent, directions = np.linalg.eigh(covariance[suspect])
        dead[suspect] = np.sqrt(np.maximum(extent, 0.0)) < STILL[quantity]
        axis[suspect] = np.abs(directions).argmax(axis=1)
    return [_AxisExtents(dead[:, k], axis[:, k], known[:, k]) for k in range(known.shape[1])]


def _moving_seconds(block: Block, edges: Array) -> Bools:
    """Seconds (seconds, sensors) in which each sensor turned."""
    return _by_second(_mean_square, block, GYR, np.searchsorted(block.t, edges), ()) > MOVES**2


def _by_second(
    measure: Compiled, block: Block, quantity: str, first: Indices, shape: tuple[int, ...]
) -> Array:
    """What `measure` gives of each sensor's samples in each second (seconds, sensors, *shape);
    zeros where there are none."""
    values = np.moveaxis(block.of(quantity), 1, 0)
    found = np.zeros((len(first) - 1, len(values), *shape))
    for k, (a, b) in enumerate(pairwise(first)):
        if b > a:
            found[k] = measure(values[:, a:b])
    return found


@rowwise("(n,v)->(v,v)")
def _step_covariance(values: Array, covariance: Array) -> None:
    """Covariance (3, 3) of the steps between samples (n, 3)."""
    total, step = np.zeros((3, 3)), np.empty(3)
    for k in range(1, len(values)):
        for i in range(3):
            step[i] = values[k, i] - values[k - 1, i]
            for j in range(i + 1):
                total[i, j] += step[i] * step[j]
    for i in range(3):
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = total[i, j] / len(values)


@rowwise("(n,v)->()")
def _mean_square(values: Array, found: Array) -> None:
    """Mean square size of vectors (n, 3); what is missing counts as zero."""
    total = 0.0
    for k in range(len(values)):
        square = values[k, 0] ** 2 + values[k, 1] ** 2 + values[k, 2] ** 2
        total += square if math.isfinite(square) else 0.0
    found[0] = total / len(values)


def _finger(sensor: str) -> str:
    return sensor.split("_")[0]


def _share(dead: Sequence[Bools], known: Sequence[Bools]) -> Array:
    """Share (seconds,) of directions that stand still, of those known."""
    counted = np.sum(known, axis=0)
    return np.asarray(
        np.where(
            counted > 0,
            np.sum([d.sum(axis=1) for d in dead], axis=0) / np.maximum(3 * counted, 1),
            0.0,
        )
    )


def _others_move(sensor: str, quantity: str, seen: Mapping[tuple[str, str], _AxisExtents]) -> Bools:
    """Seconds in which the same quantity of other fingers changes; where no other has it, seconds
    in which this one's other axes do."""
    others = [
        s for (name, q), s in seen.items() if q == quantity and _finger(name) != _finger(sensor)
    ]
    if others:
        return 1.0 - _share([s.dead for s in others], [s.known for s in others]) >= OTHERS
    return np.asarray(seen[sensor, quantity].dead.sum(axis=1) < 3)


def _standing_findings(
    sensor: str,
    quantity: str,
    own: _AxisExtents,
    others: Bools,
    moving: Bools,
    edges: Array,
) -> list[Finding]:
    stuck_seconds, axes = np.zeros(len(others), bool), ""
    for axis in range(3):
        still = (own.dead & (own.axis == axis)).any(axis=1) & others
        for a, b in find_runs(still):
            if moving[a:b].any():
                stuck_seconds[a:b], axes = True, axes + ("" if "xyz"[axis] in axes else "xyz"[axis])
    if not stuck_seconds.any():
        return []
    spans = tuple((float(edges[a]), float(edges[b])) for a, b in find_runs(stuck_seconds))
    length, start = sum(e - s for s, e in spans), spans[0][0]
    if len(axes) == 3:
        kind, what = "stuck", _stuck(WORDS[quantity], length, start)
    else:
        kind = "dead_axis"
        values = {"axes": " and ".join(axes), "what": WORDS[quantity]}
        what = (
            phrase("fault.dead_axis", **values, length=length, start=start)
            if len(axes) == 1
            else phrase("fault.dead_axes", **values, length=length, start=start)
        )
    kind = "magnetometer" if quantity == MAG else kind
    return [Finding(sensor, kind, what, CHECK, "fault", spans)]


def _stuck(what: str, length: float, start: float) -> str:
    return phrase("fault.stuck", what=what, length=length, start=start)


def _values(finding: Finding) -> Mapping[str, Value]:
    return messages_of(finding.sentence)[0].values


def _merge(found: list[Finding]) -> list[Finding]:
    """Gyroscope and accelerometer that stand still together are one finding."""
    stuck = {(f.sensor, _values(f)["what"] == WORDS[GYR]): f for f in found if f.kind == "stuck"}
    both = {s for s, gyr in stuck if gyr and (s, False) in stuck}
    merged = [
        Finding(
            s,
            "stuck",
            phrase("fault.stuck", **{**_values(stuck[s, True]), "what": BOTH}),
            CHECK,
            "fault",
            tuple(sorted({*stuck[s, True].spans, *stuck[s, False].spans})),
        )
        for s in sorted(both)
    ]
    return [f for f in found if not (f.kind == "stuck" and f.sensor in both)] + merged
