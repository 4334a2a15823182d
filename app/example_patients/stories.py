"""Six simulated people and what their hands can do over months. Nobody was measured.

Ability   what a hand can do: shares of the full fist by joint, what lacks to full extension, wrist, speed and width of tapping, speed of opening
Course    weeks before today and how far the hand is from `begin` (0) to `end` (1); in between every number is interpolated
Limits    the numbers are chosen to look like such a course, they are no reference for one
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from handscope.estimators.hand.anatomy import FINGERS, Hand
from handscope.sessions.treatment.events import Kind


@dataclass(frozen=True, kw_only=True)
class Ability:
    """What a hand can do; the default is a hand without complaint."""

    fist: Mapping[str, float] = field(default_factory=dict)  # joint -> share of the full fist; 1
    lag: Mapping[str, float] = field(default_factory=dict)  # joint -> deg short of straight; 0
    wrist: float = 1.0  # share of the wrist's range
    tap_rate: float = 3.2  # per s
    tap_opening: float = 36.0  # deg of the index finger's MCP joint
    open_rate: float = 1.1  # per s, opening and closing of the hand


@dataclass(frozen=True)
class Treated:
    """Something done to the hand."""

    weeks: float  # before today
    kind: Kind
    comment: str


@dataclass(frozen=True)
class Aim:
    """The range that a figure is to reach, in the unit that people read."""

    key: tuple[str, str, str]  # measure, task, figure
    unit: str
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Story:
    """A person and the sessions."""

    code: str  # in place of a name; words that are the same in every language of the pages
    note: str
    born: int
    hand: Hand  # that is measured
    affected: Hand | None
    dominant: Hand = "right"
    tasks: tuple[str, ...]
    begin: Ability
    end: Ability
    course: tuple[tuple[float, float], ...]  # weeks before today, share of the way; oldest first
    treated: tuple[Treated, ...] = ()
    aims: tuple[Aim, ...] = ()
    both: tuple[int, ...] = (0,)  # sessions after which the other hand follows in the same visit

    def sessions(self) -> Iterator[tuple[Hand, float, float]]:
        """Hand, weeks before today, share of the way; in the order of time."""
        other: Hand = "left" if self.hand == "right" else "right"
        for k, (weeks, share) in enumerate(self.course):
            yield self.hand, weeks, share
            if k in self.both:
                yield other, weeks, share


def between(begin: Ability, end: Ability, share: float) -> Ability:
    """The ability at a share of the way."""

    def mix(a: Any, b: Any, default: float = 0.0) -> Any:
        if isinstance(a, Mapping):
            return {j: mix(a.get(j, default), b.get(j, default)) for j in {**a, **b}}
        return a + share * (b - a)

    return Ability(
        **{
            f.name: mix(getattr(begin, f.name), getattr(end, f.name), float(f.name == "fist"))
            for f in fields(Ability)
        }
    )


def _each(fingers: tuple[str, ...], mcp: float, pip: float, dip: float) -> dict[str, float]:
    return {
        f"{f}_{joint}": value
        for f in fingers
        for joint, value in (("mcp", mcp), ("pip", pip), ("dip", dip))
    }


def _flexion(joint: str, task: str, low: float, high: float) -> Aim:
    return Aim(("range_of_motion", task, f"{joint}_flexion_max"), "deg", low, high)


LONG_FINGERS = FINGERS[1:]
STORIES = (
    Story(
        code="SIM-1 zone II",
        note="Simulated person, nobody was measured. Flexor tendons of index and middle finger repaired in zone II; measured from the sixth week on.",
        born=1991,
        hand="left",
        affected="left",
        tasks=("rom_fist", "rom_wrist"),
        begin=Ability(
            fist=_each(("index", "middle"), 0.85, 0.5, 0.25) | {"ring_dip": 0.8},
            lag=_each(("index", "middle"), 0.0, 24.0, 10.0),
            wrist=0.7,
        ),
        end=Ability(
            fist=_each(("index", "middle"), 1.0, 0.92, 0.8),
            lag=_each(("index", "middle"), 0.0, 5.0, 2.0),
        ),
        course=((18.0, 0.0), (16.0, 0.25), (13.0, 0.5), (9.0, 0.72), (5.0, 0.9), (0.3, 1.0)),
        treated=(
            Treated(24.0, "operation", "flexor tendon repair, zone II"),
            Treated(24.0, "splint", "dorsal splint, early active movement"),
        ),
        aims=(_flexion("index_pip", "rom_fist", 85.0, 105.0),),
        both=(0, 5),
    ),
    Story(
        code="SIM-2 Colles",
        note="Simulated person, nobody was measured. Distal radius fracture, plate; plaster off in the second week.",
        born=1958,
        hand="right",
        affected="right",
        tasks=("rom_wrist", "rom_fist"),
        begin=Ability(wrist=0.3, fist=_each(LONG_FINGERS, 0.8, 0.85, 0.8)),
        end=Ability(wrist=0.85),
        course=((12.0, 0.0), (10.0, 0.3), (8.0, 0.5), (5.0, 0.8), (1.0, 1.0)),
        treated=(
            Treated(15.0, "injury", "distal radius fracture"),
            Treated(14.0, "operation", "palmar plate"),
        ),
        aims=(_flexion("wrist", "rom_wrist", 40.0, 60.0),),
    ),
    Story(
        code="SIM-3 Parkinson",
        note="Simulated person, nobody was measured. Parkinson's disease; tapping slower and smaller until the medication was changed eight weeks ago.",
        born=1952,
        hand="right",
        affected="right",
        tasks=("tapping", "open_close"),
        begin=Ability(tap_rate=2.7, tap_opening=30.0, open_rate=0.9),
        end=Ability(tap_rate=1.6, tap_opening=15.0, open_rate=0.6),
        course=((30.0, 0.0), (22.0, 0.45), (15.0, 0.75), (9.0, 1.0), (5.0, 0.4), (0.6, 0.3)),
        treated=(Treated(8.0, "other", "medication changed"),),
        aims=(Aim(("tapping", "tapping", "tapping_rate"), "per s", 2.4, 3.6),),
    ),
    Story(
        code="SIM-4 hemi",
        note="Simulated person, nobody was measured. Stroke of the right hemisphere; the left hand opens slowly and not fully.",
        born=1966,
        hand="left",
        affected="left",
        tasks=("rom_fist", "open_close", "tapping"),
        begin=Ability(
            fist=_each(LONG_FINGERS, 0.7, 0.75, 0.7),
            lag=_each(LONG_FINGERS, 15.0, 30.0, 12.0),
            tap_rate=1.1,
            tap_opening=18.0,
            open_rate=0.35,
        ),
        end=Ability(
            fist=_each(LONG_FINGERS, 0.95, 0.95, 0.95),
            lag=_each(LONG_FINGERS, 4.0, 8.0, 4.0),
            tap_rate=2.4,
            tap_opening=30.0,
            open_rate=0.8,
        ),
        course=((24.0, 0.0), (20.0, 0.3), (15.0, 0.55), (9.0, 0.8), (2.0, 1.0)),
        treated=(
            Treated(26.0, "injury", "stroke, right hemisphere"),
            Treated(16.0, "botulinum_toxin", "finger flexors"),
        ),
        both=(0, 4),
    ),
    Story(
        code="SIM-5 Heberden",
        note="Simulated person, nobody was measured. Osteoarthritis of the fingers' end joints; slowly stiffer, a little better since the splint.",
        born=1949,
        hand="right",
        affected=None,
        tasks=("rom_fist",),
        begin=Ability(fist=_each(LONG_FINGERS, 1.0, 0.9, 0.7)),
        end=Ability(
            fist=_each(LONG_FINGERS, 0.98, 0.75, 0.4), lag=_each(LONG_FINGERS, 0.0, 8.0, 12.0)
        ),
        course=((45.0, 0.0), (32.0, 0.4), (20.0, 0.75), (10.0, 1.0), (3.0, 0.85)),
        treated=(Treated(8.0, "splint", "at night"),),
    ),
    Story(
        code="SIM-6 normal",
        note="Simulated person, nobody was measured. A hand without complaint, measured five times within a week: what differs is no change. It gives this hand's own MDC.",
        born=1985,
        hand="right",
        affected=None,
        tasks=("rom_fist", "tapping"),
        begin=Ability(),
        end=Ability(),
        course=tuple((weeks, 0.0) for weeks in (4.0, 3.86, 3.71, 3.57, 3.29, 0.5)),
    ),
)
