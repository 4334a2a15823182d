"""What the simulated person can do: each task is a motion that begins and ends in the relaxed posture, with the events that describe it.

Speeds and extents are those of the protocols: joint rates below 2 rad/s for guided movements (Salchow-Hoemmen 2019, 3.1.3), tapping at 2.5 Hz
(healthy 3.6 +- 0.9, Parkinson 2.6 +- 1.3 Hz in the public tapping recordings of ETF Belgrade, own evaluation), repetitions three;
those of the PowerGlove study and of the repeatability protocol stand in powerglove_tasks.py, those of other assessments in assessment_tasks.py.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.motion import (
    COORDINATES,
    Motion,
    join_motions,
    make_posture,
    move_through,
)
from handscope.estimators.simulation.movements.assessment_tasks import (
    DOWN,
    RANGES,
    ROUNDS,
    TREMORS,
    TURNING,
    UP,
    trembling,
)
from handscope.estimators.simulation.movements.grasp_postures import pinch_posture
from handscope.estimators.simulation.movements.powerglove_tasks import (
    CIRCLING,
    FAST,
    MOVEMENTS,
    POINTING,
    RAMP,
    circles,
)

# deg: the thumb of the flat pose, spread 45 deg to the side; turned 60 against the fingers (80 in
# opposition: Cooney 1981)
POSE_THUMB = 0.0, -45.0, 60.0


@dataclass(frozen=True)
class Performance:
    """A task performed: the motion and what to write into the recording's events."""

    motion: Motion
    events: tuple[Event, ...]
    # (n, 5, 3) N, of the fingers on what they hold, at instants of the motion
    forces: Callable[[Kinematics], Array] | None = None


def relaxed() -> Array:
    """The resting hand: slightly bent fingers, thumb half opposed, forearm level."""
    fingers = {
        f"{f}_{j}_flexion": a
        for f in FINGERS[1:]
        for j, a in (("mcp", 22.0), ("pip", 28.0), ("dip", 12.0))
    }
    return make_posture(
        None,
        **fingers,
        thumb_cmc_flexion=25.0,
        thumb_cmc_deviation=-25.0,
        thumb_cmc_pronation=60.0,
        thumb_mcp_flexion=12.0,
        thumb_ip_flexion=10.0,
    )


def flat() -> Array:
    """The initial pose: fingers straight and together, thumb straight and spread 45 deg."""
    flexion, deviation, pronation = POSE_THUMB
    return make_posture(
        None,
        thumb_cmc_flexion=flexion,
        thumb_cmc_deviation=deviation,
        thumb_cmc_pronation=pronation,
    )


def fist() -> Array:
    """All joints of the fingers bent, the thumb over them."""
    fingers = {
        f"{f}_{j}_flexion": a
        for f in FINGERS[1:]
        for j, a in (("mcp", 80.0), ("pip", 95.0), ("dip", 60.0))
    }
    return make_posture(
        None,
        **fingers,
        thumb_cmc_flexion=40.0,
        thumb_cmc_deviation=-10.0,
        thumb_cmc_pronation=85.0,
        thumb_mcp_flexion=35.0,
        thumb_ip_flexion=40.0,
    )


def stretched() -> Array:
    """As flat as it goes: MCP a little beyond straight."""
    return make_posture(flat(), **{f"{f}_mcp_flexion": -12.0 for f in FINGERS[1:]})


def spread() -> Array:
    """Fingers apart: the spread between neighbours of Chatzioglou 2024 (17, 14, 32 deg)."""
    deviations = {"index": -17.0, "middle": 0.0, "ring": 14.0, "little": 40.0}
    return make_posture(
        flat(),
        **{f"{f}_mcp_deviation": d for f, d in deviations.items()},
        thumb_cmc_deviation=-60.0,
    )


def initial_pose(
    geometry: HandGeometry, duration: float = 6.0, taken: Array | None = None
) -> Performance:
    """The flat pose, held; the event is the part held still and declares the flat pose even if the person holds `taken` (54,)."""
    angles = dict(
        zip(
            ("thumb_cmc_flexion_deg", "thumb_cmc_deviation_deg", "thumb_cmc_pronation_deg"),
            POSE_THUMB,
        )
    )
    held = flat() if taken is None else taken
    motion = move_through(
        [(0.0, relaxed()), (1.2, held), (duration - 1.0, held), (duration, relaxed())]
    )
    return Performance(motion, (Event(1.5, duration - 3.0, "initial_pose", angles),))


def range_of_motion(geometry: HandGeometry, repetitions: int = 3) -> Performance:
    """Fist and stretch, spread and close, thumb across, wrist up and down and sideways; each three times, ends held 0.6 s."""
    return _back_and_forth(
        "rom", [*_fist_pair(), *_spread_pair(), *_thumb_pair(), *_wrist_pairs()], repetitions
    )


def fist_and_stretch(
    geometry: HandGeometry, repetitions: int = 3, ends: tuple[Array, Array] | None = None
) -> Performance:
    """A full fist, then all fingers stretched; `ends`: how far this hand closes and opens instead."""
    return _back_and_forth("rom_fist", [ends] if ends else _fist_pair(), repetitions)


def spread_and_close(geometry: HandGeometry, repetitions: int = 3) -> Performance:
    """Straight fingers apart and together."""
    return _back_and_forth("rom_spread", _spread_pair(), repetitions)


def thumb_across_and_away(geometry: HandGeometry, repetitions: int = 3) -> Performance:
    """The thumb across the palm, then stretched away."""
    return _back_and_forth("rom_thumb", _thumb_pair(), repetitions)


def wrist_all_ways(geometry: HandGeometry, repetitions: int = 3, share: float = 1.0) -> Performance:
    """The wrist down and up, then to either side; `share` of the range of a healthy wrist."""
    return _back_and_forth("rom_wrist", _wrist_pairs(share), repetitions)


def tapping(
    geometry: HandGeometry,
    duration: float = 15.0,
    rate: float = 2.5,
    opening: float = 35.0,
    lead: float = 1.0,
    wrist: float = 0.0,
    task: str = "tapping",
) -> Performance:
    """Index finger tapping on the thumb, as wide and fast as possible; the index opens by `opening` deg at its MCP joint, the wrist bends with it."""
    closed = pinch_posture(geometry, "index", base=relaxed())
    index, thumb = ("index_mcp_flexion", "index_pip_flexion"), ("thumb_cmc_deviation",)
    opened = closed.copy()
    for name, change in (
        (index[0], -opening),
        (index[1], -0.5 * opening),
        (thumb[0], -0.35 * opening),
    ):
        opened[COORDINATES[name]] += np.radians(change)
    opened[COORDINATES["wrist_flexion"]] -= np.radians(wrist)
    return _over_and_over(
        task, closed, opened, 0.5 / rate, 0.5 / rate, int(duration * rate + 1e-9), lead
    )


def open_close(
    geometry: HandGeometry,
    duration: float = 15.0,
    rate: float = 1.0,
    lead: float = 1.0,
    task: str = "open_close",
    ends: tuple[Array, Array] | None = None,
) -> Performance:
    """Opening and closing the hand; `ends`: how far this hand opens and closes instead of fully."""
    opened, closed = ends or (stretched(), fist())
    return _over_and_over(
        task, opened, closed, 0.5 / rate, 0.5 / rate, int(duration * rate + 1e-9), lead
    )


def there_and_back(geometry: HandGeometry, task: str, lead: float = 1.0) -> Performance:
    """A movement of powerglove_tasks.MOVEMENTS or assessment_tasks.RANGES; it begins `lead` s after the hand left the relaxed posture."""
    m = MOVED[task]
    done = _over_and_over(
        task,
        make_posture(flat(), **m.back),
        make_posture(flat(), **m.there),
        m.half,
        m.move,
        m.repetitions,
        lead,
    )
    if m.phases is None:
        return done
    marks = [
        Event(
            lead + (2 * k + n) * m.half,
            m.half,
            "annotation",
            {"task_name": task, "phase": phase, "repetition": k + 1},
        )
        for k in range(m.repetitions)
        for n, phase in enumerate(m.phases)
    ]
    return Performance(done.motion, (*done.events, *marks))


def one_after_the_other(geometry: HandGeometry, task: str, lead: float = 1.0) -> Performance:
    """A round of assessment_tasks.ROUNDS; it begins `lead` s after the hand left the relaxed posture."""
    r, back = ROUNDS[task], make_posture(flat(), **ROUNDS[task].back)
    points, marks, t = _to(back, lead), [], lead
    for k in range(r.repetitions):
        for phase, angles in r.places.items():
            there = make_posture(back, **angles)
            marks.append(
                Event(
                    t,
                    r.seconds,
                    "annotation",
                    {"task_name": task, "phase": phase, "repetition": k + 1},
                )
            )
            points += [(t + r.move, there), (t + r.seconds - r.move, there), (t + r.seconds, back)]
            t += r.seconds
    motion = move_through([*points, (t + 1.0, relaxed())])
    return Performance(motion, (Event(lead, r.duration, "task", {"task_name": task}), *marks))


def pronation_supination(
    geometry: HandGeometry,
    duration: float = 15.0,
    lead: float = 1.0,
    task: str = "pronation_supination",
) -> Performance:
    """The palm turned up and down with the arm held out, as fast and as far as possible."""
    up, down = (make_posture(flat(), wrist_z=0.1, forearm_pronation=turn) for turn in (UP, DOWN))
    return _over_and_over(
        task, down, up, 0.5 / TURNING, 0.5 / TURNING, int(duration * TURNING + 1e-9), lead
    )


def tremor(
    geometry: HandGeometry, task: str, duration: float = 30.0, lead: float = 1.0
) -> Performance:
    """A hand that trembles: resting in the lap, or held out."""
    rate, extents, base = TREMORS[task]
    held = make_posture(relaxed() if task == "tremor_rest" else flat(), **base)
    motion = join_motions(
        move_through(_to(held, lead)),
        trembling(held, duration, rate, extents),
        move_through([(0.0, held), (1.0, relaxed())]),
    )
    return Performance(motion, (Event(lead, duration, "task", {"task_name": task}),))


def index_circles(
    geometry: HandGeometry,
    lead: float = 1.0,
    task: str = "powerglove_15_index_circles",
    rate: float = CIRCLING,
) -> Performance:
    """The index finger draws ten circles in the air, `rate` a second."""
    circle = circles(make_posture(flat(), **POINTING), rate=rate)
    start = circle.spline(0.0)
    motion = join_motions(
        move_through(_to(start, lead)), circle, move_through([(0.0, start), (1.0, relaxed())])
    )
    return Performance(motion, (Event(lead, circle.duration, "task", {"task_name": task}),))


def rest(geometry: HandGeometry, duration: float = 10.0) -> Performance:
    """The relaxed hand, not moving."""
    return Performance(
        move_through([(0.0, relaxed()), (duration, relaxed())]), (Event(0.0, duration, "rest", {}),)
    )


def wiggle(geometry: HandGeometry, fingers: tuple[str, ...] = FINGERS) -> Performance:
    """One finger after the other bends: what is asked for when the sensors are checked."""
    points, t = [(0.0, relaxed())], 0.4
    for f in fingers:
        names = (
            ("thumb_mcp_flexion", "thumb_ip_flexion")
            if f == "thumb"
            else (f"{f}_mcp_flexion", f"{f}_pip_flexion", f"{f}_dip_flexion")
        )
        bent = relaxed()
        for name in names:
            bent[COORDINATES[name]] += np.radians(35.0)
        points += [(t, relaxed()), (t + 0.7, bent), (t + 1.4, relaxed())]
        t += 1.6
    return Performance(
        move_through(points), (Event(0.4, points[-1][0] - 0.4, "task", {"task_name": "wiggle"}),)
    )


MOVED = {**MOVEMENTS, **RANGES}
# tasks that begin when the countdown is over, and then keep time with it
IN_STEP: Mapping[str, Callable[..., Performance]] = {
    **{name: partial(there_and_back, task=name) for name in MOVED},
    **{name: partial(one_after_the_other, task=name) for name in ROUNDS},
    "powerglove_11_tapping": partial(tapping, duration=30.0, task="powerglove_11_tapping"),
    "powerglove_12_tapping_wrist": partial(
        tapping, duration=30.0, wrist=20.0, task="powerglove_12_tapping_wrist"
    ),
    "powerglove_13_open_close": partial(
        open_close, duration=30.0, rate=0.5 / FAST, task="powerglove_13_open_close"
    ),
    "powerglove_15_index_circles": index_circles,
    "circular_pointing": partial(
        index_circles, task="circular_pointing", rate=10 / (10.0 - RAMP)
    ),  # ten in 10 s
}
TIMED: Mapping[str, Callable[..., Performance]] = {  # of a given duration
    "tapping": tapping,
    "open_close": open_close,
    "pronation_supination": pronation_supination,
    **{name: partial(tremor, task=name) for name in TREMORS},
    "rest": rest,
}
TASKS: Mapping[str, Callable[..., Performance]] = {
    "initial_pose": initial_pose,
    "rom": range_of_motion,
    "rom_fist": fist_and_stretch,
    "rom_spread": spread_and_close,
    "rom_thumb": thumb_across_and_away,
    "rom_wrist": wrist_all_ways,
    "wiggle": wiggle,
    **TIMED,
    **IN_STEP,
}


def _back_and_forth(task: str, pairs: list[tuple[Array, Array]], repetitions: int) -> Performance:
    """Each pair of postures in turn, `repetitions` times; 1.6 s there, held 0.6 s."""
    points, t = [(0.0, relaxed()), (1.0, flat())], 1.0
    for pair in pairs:
        for _ in range(repetitions):
            for target in pair:
                points += [(t + 1.6, target), (t + 2.2, target)]
                t += 2.2
    motion = move_through([*points, (t + 1.2, relaxed())])
    return Performance(motion, (Event(1.0, t - 1.0, "task", {"task_name": task}),))


def _over_and_over(
    task: str, back: Array, there: Array, half: float, move: float, repetitions: int, lead: float
) -> Performance:
    """There and back: each way takes `half` s, `move` of them in movement, the rest at its end."""
    points = _to(back, lead)
    for k in range(2 * repetitions):
        target = back if k % 2 else there
        points += [(lead + k * half + move, target)] if move < half else []
        points.append((lead + (k + 1) * half, target))
    end = points[-1][0]
    return Performance(
        move_through([*points, (end + 1.0, relaxed())]),
        (Event(lead, end - lead, "task", {"task_name": task}),),
    )


def _to(start: Array, lead: float) -> list[tuple[float, Array]]:
    """From the relaxed posture to where a movement starts, and waiting there until `lead` s have passed."""
    points = [(0.0, relaxed()), (min(1.0, lead), start)]
    return [*points, (lead, start)] if lead > 1.0 else points


def _fist_pair() -> list[tuple[Array, Array]]:
    return [(fist(), stretched())]


def _spread_pair() -> list[tuple[Array, Array]]:
    return [(spread(), flat())]


def _thumb_pair() -> list[tuple[Array, Array]]:
    return [(_across(), _away())]


def _wrist_pairs(share: float = 1.0) -> list[tuple[Array, Array]]:
    return [
        (_wrist(flexion=50.0 * share), _wrist(flexion=-45.0 * share)),
        (_wrist(deviation=25.0 * share), _wrist(deviation=-15.0 * share)),
    ]


def _across() -> Array:
    return make_posture(
        flat(),
        thumb_cmc_flexion=45.0,
        thumb_cmc_deviation=10.0,
        thumb_cmc_pronation=95.0,
        thumb_mcp_flexion=50.0,
        thumb_ip_flexion=65.0,
    )


def _away() -> Array:
    return make_posture(
        flat(), thumb_cmc_deviation=-60.0, thumb_mcp_flexion=-8.0, thumb_ip_flexion=-10.0
    )


def _wrist(flexion: float = 0.0, deviation: float = 0.0) -> Array:
    return make_posture(flat(), wrist_flexion=flexion, wrist_deviation=deviation)
