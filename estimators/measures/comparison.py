"""Agreement of two recordings of one movement: ours against an optical system, or method against method.

In      two trajectories, the lag of their clocks (synchronisation.py), stretches of time on A's clock
Out     for every angle that both hold, and for the distance between the tips of thumb and index: dRMS, offset, dRMS minus offset, dRoM, limits of agreement
Signs   a difference is B minus A
Source  Kortier, thesis 3.2.5 and Table 3.2; limits of agreement: Bland & Altman 1986, Lancet 327:307
Limits  the samples of one movement are no independent measurements: the limits describe this recording, they carry no confidence interval
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from handscope.estimators.data.samples import GYR, Block, Event
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINTS, SEGMENT
from handscope.estimators.measures.synchronisation import Signal, interpolate
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LIMIT = 1.96  # standard deviations: 95 % of normally distributed differences
# what the instrument itself does not claim to know; clipping stays in
UNKNOWN = np.uint8(Flag.MISSING | Flag.HEADING_LOST | Flag.FAULTY)
# rad/s that a segment's rate must reach; ours: the noise of a gyroscope stays below a tenth of it
TURNED = np.radians(10.0)
TIPS = "thumb_index_distance"
WHOLE = "whole recording"


@dataclass(frozen=True)
class Pair:
    """One quantity as both recordings hold it, at the samples of A; NaN where either lacks it."""

    name: str  # index_pip_flexion, ..., thumb_index_distance
    unit: Literal["rad", "m"]
    t: Array  # (n,) s, A's clock
    a: Array  # (n,)
    b: Array  # (n,)

    @property
    def both(self) -> Array:
        """(2, k) values of A and B where both are known."""
        known = np.isfinite(self.a) & np.isfinite(self.b)
        return np.stack([self.a[known], self.b[known]])

    def between(self, start: float, stop: float) -> "Pair":
        first, last = np.searchsorted(self.t, [start, np.nextafter(stop, np.inf)])
        return Pair(
            self.name, self.unit, self.t[first:last], self.a[first:last], self.b[first:last]
        )


@dataclass(frozen=True)
class Agreement:
    """How far B is from A in one quantity during one task; SI units."""

    task: str
    onset: float  # s, A's clock
    end: float  # s
    name: str
    unit: Literal["rad", "m"]
    samples: int
    share: float  # of A's samples in the stretch that could be compared
    drms: float
    offset: float  # mean difference
    drms_minus_offset: float  # RMS of the difference once the offset is taken off
    rom_a: float
    rom_b: float
    sd: float  # of the difference
    correlation: float  # NaN where either stands still

    @property
    def drom(self) -> float:
        return self.rom_b - self.rom_a

    @property
    def limits(self) -> tuple[float, float]:
        return self.offset - LIMIT * self.sd, self.offset + LIMIT * self.sd


@dataclass(frozen=True)
class Consistency:
    """Difference of the angular velocity of the estimated orientation from that of its own gyroscope."""

    segment: str
    drms: float  # rad/s, of the norms: free of frames
    largest: float  # rad/s, the gyroscope's largest norm

    @property
    def share(self) -> float:
        """dRMS as a share of the largest rate: what the thesis gives in % of maximum; NaN of a segment that hardly turned, where it would be a ratio of noises."""
        return self.drms / self.largest if self.largest > TURNED else np.nan


def shared_names(a: Trajectory, b: Trajectory) -> tuple[list[str], Signal, Signal]:
    """Names and values of the angles that both hold anywhere; the distance of thumb and index tip where they share no angle."""
    angles_a, angles_b = _known_angles(a), _known_angles(b)
    columns = [
        (j, k)
        for j in range(len(JOINTS))
        for k in range(3)
        if np.isfinite(angles_a[:, j, k]).any() and np.isfinite(angles_b[:, j, k]).any()
    ]
    if columns:
        j, k = np.array(columns).T
        names = [f"{JOINTS[j].name}_{ANGLES[k]}" for j, k in columns]
        return names, Signal(a.t, angles_a[:, j, k]), Signal(b.t, angles_b[:, j, k])
    tips = [Signal(x.t, tip_distance(x)[:, None]) for x in (a, b)]
    return ([TIPS] if all(np.isfinite(s.values).any() for s in tips) else []), tips[0], tips[1]


def pair_quantities(a: Trajectory, b: Trajectory, lag: float) -> list[Pair]:
    """All that both hold, B brought to A's samples by splines; t_A = t_B + lag."""
    names, on_a, on_b = shared_names(a, b)
    if not names:
        return []
    angles = [] if names == [TIPS] else _pairs(names, "rad", on_a, on_b, lag)
    tips = [Signal(x.t, tip_distance(x)[:, None]) for x in (a, b)]
    return angles + (
        _pairs([TIPS], "m", tips[0], tips[1], lag)
        if all(np.isfinite(s.values).any() for s in tips)
        else []
    )


def list_stretches(
    a: Sequence[Event], b: Sequence[Event], lag: float, span: tuple[float, float]
) -> list[tuple[str, float, float]]:
    """Name, onset and end on A's clock of the whole recording and of each task: those of A, or of B where A has none."""
    tasks = [(e, 0.0) for e in a if _is_task(e)] or [(e, lag) for e in b if _is_task(e)]
    return [
        (WHOLE, *span),
        *((str(e.details.get("task_name", "task")), e.onset + s, e.end + s) for e, s in tasks),
    ]


def agreements(pairs: Sequence[Pair], parts: Sequence[tuple[str, float, float]]) -> list[Agreement]:
    """One agreement for every stretch and every pair that holds something there."""
    found = []
    for task, onset, end in parts:
        for pair in pairs:
            part = pair.between(onset, end)
            a, b = part.both
            if len(a) >= 2:
                found.append(_agreement(task, onset, end, part, a, b))
    return found


def tip_distance(trajectory: Trajectory) -> Array:
    """Distance (n,) m between the tips of thumb and index: the amplitude of tapping."""
    return np.asarray(
        np.linalg.norm(
            trajectory.tips[:, FINGERS.index("thumb")] - trajectory.tips[:, FINGERS.index("index")],
            axis=-1,
        )
    )


def gyroscope_consistency(
    trajectory: Trajectory,
    blocks: Iterable[Block],
    biases: Mapping[str, Array],
    means: bool = False,
) -> list[Consistency]:
    """Angular velocity from q_GS against the gyroscopes, segment by segment; `means`: a gyroscope's sample is the mean rate since the one before.

    Source: Kortier, thesis 3.2.5: dRMS of the norm against the largest angular velocity measured.
    """
    if len(trajectory) < 2:
        return []
    dt = np.diff(trajectory.t)
    middle = trajectory.t[:-1] + 0.5 * dt
    found = []
    for block in blocks:
        if GYR not in block.stream.quantities or len(block.t) < 2:
            continue
        t = block.t - (0.5 / block.stream.rate if means else 0.0)
        for k, segment in enumerate(block.stream.sensors):
            if segment not in SEGMENT:
                continue
            q_GS = trajectory.q_GS[:, SEGMENT[segment]]
            estimated = np.linalg.norm(quat.log(quat.relative(q_GS[:-1], q_GS[1:])), axis=-1) / dt
            gyr = block.of(GYR)[:, k] - biases.get(segment, np.zeros(3))
            norm = np.linalg.norm(
                [np.interp(middle, t, w, left=np.nan, right=np.nan) for w in gyr.T], axis=0
            )
            difference = estimated - norm
            if np.isfinite(difference).any():
                found.append(
                    Consistency(
                        segment,
                        float(np.sqrt(np.nanmean(difference**2))),
                        float(np.nanmax(np.linalg.norm(gyr, axis=-1))),
                    )
                )
    return found


def _known_angles(trajectory: Trajectory) -> Array:
    """Angles (n, joints, 3), NaN where a segment's flags say that the instrument did not measure them."""
    unknown = (trajectory.flags & UNKNOWN) != 0
    of_joint = np.stack(
        [unknown[:, SEGMENT[j.parent]] | unknown[:, SEGMENT[j.child]] for j in JOINTS], axis=-1
    )
    return np.where(of_joint[..., None], np.nan, trajectory.angles)


def _pairs(
    names: Sequence[str], unit: Literal["rad", "m"], a: Signal, b: Signal, lag: float
) -> list[Pair]:
    values = interpolate(b, a.t - lag)
    return [
        Pair(name, unit, a.t, a.values[:, k], values[:, k])
        for k, name in enumerate(names)
        if np.isfinite(a.values[:, k] + values[:, k]).any()
    ]


def _is_task(event: Event) -> bool:
    return event.trial_type == "task" and not event.details.get("excluded")


def _agreement(task: str, onset: float, end: float, part: Pair, a: Array, b: Array) -> Agreement:
    d = b - a
    offset = float(d.mean())
    moving = np.ptp(a) > 1e-9 and np.ptp(b) > 1e-9
    return Agreement(
        task,
        onset,
        end,
        part.name,
        part.unit,
        len(d),
        len(d) / len(part.t),
        float(np.sqrt((d**2).mean())),
        offset,
        float(np.sqrt(((d - offset) ** 2).mean())),
        float(np.ptp(a)),
        float(np.ptp(b)),
        float(d.std(ddof=1)),
        float(np.corrcoef(a, b)[0, 1]) if moving else float("nan"),
    )
