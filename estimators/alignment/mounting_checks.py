"""Sensors that sit turned against their nominal mounting, and strips that are exchanged, from the
initial pose and the first flexions.

In      samples of all inertial streams, one block each; the pose's stretch; nominal mounting
Out     Findings: which of the 24 right-angled turns a sensor has, which strips are exchanged
Source  gravity in the pose and the axis of a hinge in flexion are what Salchow-Hoemmen 2019, 2.4.2,
        and Kortier's thesis, (2.34), calibrate with; rules ours
Limits  turned: with the palm level gravity does not show a turn about the vertical, only the
        flexions do; with the palm upright a turn about the flexion axis is seen by neither. The
        hand's own sensor is judged against the fingers': with fewer than three other sensors
        there is no finding. exchanged: thumb and finger by gravity where the pose spreads the thumb,
        fingers among each other only by their tasks: the order of `wiggle`, the one
        finger that a task is named after, the index in `tapping`. In a free recording two fingers'
        strips exchanged look like two fingers that moved so.
"""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import ACC, GYR, Block, Event
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENTS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

OFF = np.radians(45.0)  # from here on the next right angle is nearer than the nominal mounting
EXCHANGED = np.radians(30.0)  # mean misfit of two strips in their own places ...
# ... and in each other's: twice the 5 to 10 deg of misalignment (Salchow-Hoemmen 2019, 5)
FITS = np.radians(25.0)
BENDS = 0.5  # rad/s
FIRST = 20.0  # s behind the pose that count as the first flexions
LEAST_BENT = 0.3  # s of bending
EXTENDS = np.radians(60.0)  # more than any straight finger: MCP joints 45 deg (anatomy.py)
PLANAR = 0.8  # share of the principal axis
MOVES = 1.0  # rad/s, root mean square of a finger asked to move
DIFFERENT = 0.5  # s between two fingers of a wiggle


@dataclass(frozen=True)
class _WornSensor:
    """One sensor with what it saw."""

    nominal: Array  # (4,) q_BS
    on_hand: Array  # (4,) segment on the hand in the pose
    up: Array  # (3,) gravity's opposite in the pose, sensor frame
    t: Array
    rate: Array  # (n, 3) rad/s behind the pose, bias removed, sensor frame

    def up_on_hand(self, on_hand: Array | None = None) -> Array:
        """Where the hand's up would be if this sensor sat as it should on a segment that lies
        so."""
        return quat.rotate(
            quat.multiply(self.on_hand if on_hand is None else on_hand, self.nominal), self.up
        )

    @cached_property
    def size(self) -> Array:
        x, y, z = self.rate.T
        return np.asarray(np.sqrt(x * x + y * y + z * z))


def check(
    blocks: Sequence[Block],
    mounting: Mapping[str, Array],
    pose: initial_pose.Pose,
    events: Sequence[Event],
) -> list[Finding]:
    """What is turned and what is exchanged."""
    tasks = _first_tasks(events)
    until = max([pose.end + FIRST, *(e.end for e in tasks)])
    worn = _worn_sensors(blocks, mounting, pose, until)
    if len(worn) < 4 or "hand" not in worn:
        return []
    up = _common_direction({n: w.up_on_hand() for n, w in worn.items() if n not in CHAINS["thumb"]})
    exchanged = _check_thumb_exchange(worn, up) or _check_finger_exchange(worn, tasks)
    spoken = {f.sensor for f in exchanged if f.severity == "fault"}
    return exchanged + [
        f
        for n, w in worn.items()
        if n not in spoken
        for f in [_check_turn(n, w, worn, up)]
        if f is not None
    ]


def is_other_hands_thumb(
    blocks: Sequence[Block], mounting: Mapping[str, Array], pose: initial_pose.Pose
) -> bool:
    """Whether in a pose with the thumb turned its sensors see gravity as those of the other hand's thumb do, which is turned the other way."""
    worn = _worn_sensors(blocks, mounting, pose, pose.end)
    thumb = [s for s in CHAINS["thumb"] if s in worn]
    if len(worn) < 4 or "hand" not in worn or len(thumb) < 2:
        return False
    up = _common_direction({n: w.up_on_hand() for n, w in worn.items() if n not in thumb})
    flexion, deviation, pronation = pose.thumb_cmc
    mirrored = replace(pose, thumb_cmc=(flexion, -deviation, -pronation))
    on_hand = initial_pose.segments_in_pose(mirrored)
    own = [_between(worn[s].up_on_hand(), up) for s in thumb]
    others = [_between(worn[s].up_on_hand(on_hand[s]), up) for s in thumb]
    return bool(min(own) > OFF and max(others) < FITS)


def _worn_sensors(
    blocks: Sequence[Block], mounting: Mapping[str, Array], pose: initial_pose.Pose, until: float
) -> dict[str, _WornSensor]:
    on_hand, found = initial_pose.segments_in_pose(pose), {}
    for block in (b for b in blocks if b.stream.inertial):
        nominal = initial_pose.nominal_mounting(block.stream.sensors, mounting)
        still, later = block.between(pose.onset, pose.end), block.between(pose.end, until)
        for k, name in enumerate(block.stream.sensors):
            values = still.values[:, k]
            values = values[np.isfinite(values).all(axis=1)]
            if name in SEGMENTS and len(values) > 0.5 * len(still.t) > 1:
                mean = values.mean(axis=0)
                acc = mean[block.stream.axes(ACC)]
                if np.linalg.norm(acc) > 1.0:
                    rate = np.nan_to_num(later.of(GYR)[:, k] - mean[block.stream.axes(GYR)])
                    found[name] = _WornSensor(
                        nominal[name], on_hand[name], acc / np.linalg.norm(acc), later.t, rate
                    )
    return found


def _common_direction(up: Mapping[str, Array]) -> Array:
    """The direction that most sensors agree on: the one with the least median angle to all."""
    directions = np.array(list(up.values()))
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    return np.asarray(directions[int(np.argmin(np.median(angles, axis=1)))])


def _between(a: Array, b: Array) -> float:
    return float(np.arccos(np.clip(a @ b, -1, 1)))


def _check_thumb_exchange(worn: Mapping[str, _WornSensor], up: Array) -> list[Finding]:
    """The thumb's strip and a finger's: each misfits in its own place and fits in the other's."""
    thumb = [worn[s] for s in CHAINS["thumb"] if s in worn]
    for finger in FINGERS[1:]:
        strip = [worn[s] for s in CHAINS[finger] if s in worn]
        if len(thumb) < 2 or len(strip) < 2:
            continue
        own = [np.mean([_between(w.up_on_hand(), up) for w in part]) for part in (thumb, strip)]
        crossed = [
            np.mean([_between(w.up_on_hand(o[0].on_hand), up) for w in part])
            for part, o in ((thumb, strip), (strip, thumb))
        ]
        if min(own) > EXCHANGED and max(crossed) < FITS:
            return _pair("thumb", finger, phrase("mounting.crossed_in_pose"), worn)
    return []


def _pair(one: str, other: str, why: str, worn: Mapping[str, _WornSensor]) -> list[Finding]:
    sentence = (
        phrase("mounting.exchanged_thumb", other=other, why=why)
        if one == "thumb"
        else phrase("mounting.exchanged_fingers", one=one, other=other, why=why)
    )
    fix = phrase("mounting.exchange", one=one, other=other)
    return [
        Finding(s, "swapped", sentence, fix, "fault")
        for f in (one, other)
        for s in CHAINS[f]
        if s in worn
    ]


def _check_finger_exchange(
    worn: Mapping[str, _WornSensor], events: Sequence[Event]
) -> list[Finding]:
    """Exchanged fingers, found from their tasks."""
    for event in events:
        if (
            found := _check_wiggle(worn, event)
            if _task(event) == "wiggle"
            else _check_one_finger(worn, event, str(_finger(event)))
        ):
            return found
    return []


def _first_tasks(events: Sequence[Event]) -> list[Event]:
    """The first of each task that says which finger moves."""
    first: dict[str, Event] = {}
    for event in sorted(events, key=lambda e: e.onset):
        if _task(event) == "wiggle" or _finger(event):
            first.setdefault(_task(event), event)
    return list(first.values())


def _task(event: Event) -> str:
    return str(event.details.get("task_name", ""))


def _finger(event: Event) -> str | None:
    """The one finger that a task is named after; tapping is the index's. The thumb's strip is recognised by gravity."""
    words = re.split("[^a-z]+", _task(event).lower())
    named = [f for f in FINGERS if f in words]
    if not named and "tapping" in words:
        return "index"
    return named[0] if len(named) == 1 and named[0] != "thumb" else None


def _check_wiggle(worn: Mapping[str, _WornSensor], event: Event) -> list[Finding]:
    """One finger after the other bends, thumb first: two that bend in each other's turn are
    exchanged."""
    turn = {f: when for f in FINGERS if (when := _bending_time(worn, f, event)) is not None}
    came, due = sorted(turn, key=lambda f: turn[f]), [f for f in FINGERS if f in turn]
    if len(due) < 3 or min(np.diff(sorted(turn.values()))) < DIFFERENT:
        return []
    wrong = [f for f, g in zip(due, came) if f != g]
    if len(wrong) == 2:
        return _pair(
            wrong[0],
            wrong[1],
            phrase("mounting.bent_in_turn"),
            worn,
        )
    sentence = phrase("mounting.order", order=", ".join(came))
    return [
        Finding(
            s,
            "swapped",
            sentence,
            phrase("mounting.check_strips"),
            "warning",
        )
        for f in wrong
        for s in CHAINS[f][:1]
    ]


def _bending_time(worn: Mapping[str, _WornSensor], finger: str, event: Event) -> float | None:
    """The middle of the time at which a finger bent, None where it did not or all the time."""
    bend = _bending_rate(worn, finger)
    if bend is None:
        return None
    t, speed = bend
    inside = (t >= event.onset) & (t < event.end)
    weight = np.where(inside & (speed > 0.3 * BENDS), speed**2, 0.0)
    if weight.sum() < 10 * BENDS**2:
        return None
    middle = float(np.average(t, weights=weight))
    return (
        middle if np.sqrt(np.average((t - middle) ** 2, weights=weight)) < 2 * DIFFERENT else None
    )


def _bending_rate(worn: Mapping[str, _WornSensor], finger: str) -> tuple[Array, Array] | None:
    """How fast (rad/s) the end of a finger turns against its beginning, whatever their frames."""
    first, last = CHAINS[finger][0], CHAINS[finger][-1]
    if first not in worn or last not in worn or len(worn[first].t) != len(worn[last].t):
        return None
    return worn[first].t, np.abs(worn[last].size - worn[first].size)


def _check_one_finger(worn: Mapping[str, _WornSensor], event: Event, finger: str) -> list[Finding]:
    """One finger moves: another that moves three times as much has its strip."""
    moved = {}
    for other in FINGERS[1:]:
        w = worn.get(CHAINS[other][-1])
        if w is not None and (inside := (w.t >= event.onset) & (w.t < event.end)).sum() > 50:
            moved[other] = float(np.sqrt(np.mean(w.size[inside] ** 2)))
    most = max(moved, key=lambda f: moved[f], default=finger)
    if finger not in moved or most == finger or moved[most] < max(3 * moved[finger], MOVES):
        return []
    return _pair(
        finger,
        most,
        phrase("mounting.other_finger_moved", task=_task(event), most=most, finger=finger),
        worn,
    )


def _check_turn(
    name: str, w: _WornSensor, worn: Mapping[str, _WornSensor], up: Array
) -> Finding | None:
    """The right-angled turn that explains gravity in the pose and the axis of flexion better than
    the nominal mounting does."""
    expected, axis = (
        quat.rotate(quat.conjugate(quat.multiply(w.on_hand, w.nominal)), up),
        _flexion_axis(name, worn),
    )
    z = quat.rotate(quat.conjugate(w.nominal), np.array([0.0, 0, 1]))

    def misfit(turn: Array) -> float:
        back = quat.conjugate(turn)
        return max(
            _between(quat.rotate(back, expected), w.up),
            0.0 if axis is None else _between(quat.rotate(back, z), axis),
        )

    as_drawn = misfit(quat.IDENTITY)
    if as_drawn < OFF:
        return None
    # of those that fit the least turn
    best = min(
        _right_angles(), key=lambda q: (misfit(q) > FITS, round(float(quat.angle(q)), 3), misfit(q))
    )
    if as_drawn - misfit(best) < OFF / 2:
        return None
    angle, q = (
        round(float(np.degrees(quat.angle(best)))),
        quat.normalize(quat.multiply(w.nominal, best)),
    )
    seen = (
        phrase("mounting.seen_in_pose_and_flexions")
        if axis is not None
        else phrase("mounting.seen_in_pose")
    )
    if axis is None:
        sentence = phrase("mounting.turned", angle=angle, seen=seen)
        return Finding(name, "turned", sentence, phrase("mounting.as_drawn"), "fault")
    turned = phrase("mounting.turned_about", angle=angle, axis=_axis_words(best), seen=seen)
    values = str([round(float(x), 3) + 0.0 for x in q])
    fix = phrase("mounting.as_drawn_or_set", mounting=values)
    return Finding(name, "turned", turned, fix, "fault")


def _flexion_axis(name: str, worn: Mapping[str, _WornSensor]) -> Array | None:
    """Axis (3,) about which the sensor turned when its finger first bent, with the sign of flexion;
    None where nothing bent in a plane.

    The thumb's carpometacarpal joint has no fixed axis: only what its two hinges do while its
    metacarpal rests counts.
    """
    finger = name.split("_")[0]
    if (
        finger not in CHAINS
        or name not in CHAINS[finger]
        or name == "thumb_metacarpal"
        or (bend := _bending_rate(worn, finger)) is None
    ):
        return None
    w, hand, base = worn[name], worn["hand"], worn[CHAINS[finger][0]]
    if len(w.t) != len(bend[0]) or len(w.t) < 10:
        return None
    first = slice(int(np.searchsorted(w.t, w.t[0] + FIRST)))
    t, size, rate = w.t[first], w.size[first], w.rate[first]
    period = float(np.median(np.diff(t)))
    hand_moves = np.interp(t, hand.t, hand.size) if len(hand.t) > 1 else np.zeros(len(t))
    bent = (bend[1][first] > BENDS) & (size > BENDS) & (hand_moves < 0.25 * size)
    bent &= base.size[first] < 0.3 * size if finger == "thumb" else True
    if bent.sum() * period < LEAST_BENT:
        return None
    spread, axes = np.linalg.eigh(rate[bent].T @ rate[bent])
    if spread[-1] < PLANAR * spread.sum():
        return None
    axis = axes[:, -1]
    along, rests = rate @ axis, hand_moves < BENDS
    turned = np.cumsum(np.where(rests, along, 0.0)) * period
    # what it turned against the hand while that moved may have been either way
    unseen = float(np.where(rests, 0.0, np.abs(along) + hand_moves).sum()) * period
    carried = _turned_slowly(hand, t)
    # from straight a finger can only flex far
    forth, back = float(turned.max()), float(-turned.min())
    if max(forth, back) < max(EXTENDS, 2 * (min(forth, back) + unseen + carried)):
        return None
    return np.asarray(axis if forth > back else -axis)


def _turned_slowly(hand: _WornSensor, t: Array) -> float:
    """How far (rad) the hand turned at most while it counted as resting, up to the end of t (n,)."""
    until = np.searchsorted(hand.t, t[-1])
    if until < 2:
        return 0.0
    slow = np.where(hand.size[:until, None] < BENDS, hand.rate[:until], 0.0)
    turned = np.cumsum(slow, axis=0) * float(np.median(np.diff(hand.t)))
    return float(np.linalg.norm(turned, axis=1).max())


@cache  # made when first asked for: importing loads no kernel
def _right_angles() -> list[Array]:
    """The 24 turns that take axes to axes, least first."""
    found: list[Array] = []
    for order in itertools.permutations(np.eye(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            R = np.array(order) * np.array(signs)[:, None]
            if np.linalg.det(R) > 0:
                found.append(quat.from_matrix(R))
    return sorted(found, key=lambda q: float(quat.angle(q)))


AXES = (  # and the opposite ones
    (phrase("mounting.axis_x"), phrase("mounting.axis_minus_x")),
    (phrase("mounting.axis_y"), phrase("mounting.axis_minus_y")),
    (phrase("mounting.axis_z"), phrase("mounting.axis_minus_z")),
)


def _axis_words(q: Array) -> str:
    axis = q[1:] / np.linalg.norm(q[1:])
    k = int(np.argmax(np.abs(axis)))
    if abs(axis[k]) <= 0.9:
        return phrase("mounting.diagonal_axis")
    return AXES[k][1 if axis[k] * (1 if q[0] >= 0 else -1) < 0 else 0]
