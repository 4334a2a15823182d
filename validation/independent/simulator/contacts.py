"""Contacts held between the pose and the free movement: thumb on fingertips, fingertips on a table, fingertips on the palm; by closed formulas and a search of their own.

Frames  as in free_movement.py; pads are points that lie a bone's thickness below the last bone's end, drawn for each person
Limits  the forearm is level meanwhile, as in the pose; a table is tilted and pads reach below the bone as drawn; a crease lies as drawn before its joint
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from handscope.validation.independent.simulator.free_movement import (
    BEGUN,
    CHAINS,
    DEG,
    Array,
    Body,
    Held,
    Movement,
    Setup,
    _body,
    _joint_rotations,
    _rng,
    after_pose,
    free,
)

MOVING, HOLDING = 1.2, 2.0  # s to a posture, and in it
THICK = {"thumb": 0.0085, "index": 0.007, "middle": 0.007, "ring": 0.0068, "little": 0.006}  # m
THICK_SD, BESIDE, CREASE_SD = 0.0012, 0.003, 0.004  # m
CREASE = np.array([-0.017, -0.0085, 0.0])  # m, from an MCP joint: dorsal, distal, ulnar
TILT = 0.8 * DEG
GUESS = {  # deg: CMC z x y, MCP, IP; MCP z x, PIP, DIP
    "pinch": ((40, -20, 70, 20, 25), (50, 0, 45, 25)),
    "table": ((32, -35, 50, 10, 10), (30, 0, 40, 20)),
    "palm": ((40, -10, 85, 35, 45), (68, 0, 98, 62)),
}
LOW, HIGH = ((-10, -60, 0, -5, -5), (-15, -18, 0, 0)), ((65, 15, 115, 60, 70), (92, 18, 116, 90))


@dataclass(frozen=True)
class _Hold:
    words: str
    angles: Mapping[str, Array]  # (3, 3) rad, by finger


def with_contacts(
    setup: Setup, kinds: Sequence[str], separation: float = 0.0
) -> tuple[Movement, tuple[Held, ...], float]:
    """The set-up's movement with contacts between pose and free movement, what was held, and when the free movement begins (s).

    With `separation` (m) nothing touches: pads stay so far from each other and from the palm, and up to it above the table.
    """
    assert setup.missed is not None
    body, rng = _body(setup), _rng(setup, 9)
    holds = [hold for kind in kinds for hold in HOLDS[kind](setup, body, rng, separation)]
    shift = len(holds) * (MOVING + HOLDING) + MOVING
    plain = after_pose(setup, setup.missed, free(setup))
    times = [BEGUN - 2.0 + MOVING + k * (MOVING + HOLDING) for k in range(len(holds))]

    def late(t: Array) -> Array:
        """The plain movement's time: it waits at the pose's end while contacts are held."""
        return np.where(t < BEGUN - 2.0, t, np.maximum(t - shift, BEGUN - 2.0))

    def angles(f: str, t: Array) -> Array:
        x = plain.angles[f](late(t))
        for hold, start in zip(holds, times):
            share = _smooth((t - start + MOVING) / MOVING) * _smooth(
                (start + HOLDING + MOVING - t) / MOVING
            )
            x = x + share[:, None, None] * (
                hold.angles[f] - plain.angles[f](np.array([BEGUN - 2.0]))
            )
        return np.asarray(x)

    moved = Movement(
        {f: (lambda t, f=f: angles(f, t)) for f in CHAINS},  # type: ignore[misc]
        lambda t: plain.wrist(late(t)),
        lambda t: plain.turns(late(t)),
        lambda t: plain.wanders(late(t)),
    )
    held = tuple(
        Held(hold.words, start + 0.2, start + HOLDING - 0.2) for hold, start in zip(holds, times)
    )
    return moved, held, BEGUN + shift


def _smooth(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3))


def _pinches(setup: Setup, body: Body, rng: np.random.Generator, separation: float) -> list[_Hold]:
    thick, found = _thick(rng), []
    for finger in ("index", "middle", "ring", "little"):
        beside = BESIDE * rng.normal(size=3)

        def missed(pads: Mapping[str, Array], f: str = finger, off: Array = beside) -> Array:
            return _missed(pads["thumb"] - pads[f] - off, separation)

        angles = _solve_angles(setup, body, thick, "pinch", ("thumb", finger), missed)
        found.append(_Hold(f"thumb_bottom-{finger}_bottom", angles))
    return found


def _table(setup: Setup, body: Body, rng: np.random.Generator, separation: float) -> list[_Hold]:
    """Pads on one plane below the hand."""
    assert setup.missed is not None
    thick, tilt = _thick(rng), TILT * rng.normal(size=2)
    wrist = after_pose(setup, setup.missed, free(setup)).wrist(np.zeros(1))
    level = _joint_rotations(wrist)[0] if setup.forearm else np.eye(3)  # the forearm is level
    angles: dict[str, Array] = {}
    for finger in CHAINS:
        above = rng.uniform(0.0, separation) if separation else 0.0

        def missed(pads: Mapping[str, Array], f: str = finger, lift: float = above) -> Array:
            x, y, z = setup.side * level @ pads[f]
            return np.array([x + 0.06 - lift - tilt @ (y, z)])

        one = _solve_angles(setup, body, thick, "table", (finger,), missed, straight_down=True)
        angles[finger] = one[finger]
    return [_Hold(" ".join(f"{f}_bottom-table_top" for f in CHAINS), angles)]


def _palm(setup: Setup, body: Body, rng: np.random.Generator, separation: float) -> list[_Hold]:
    thick, found = _thick(rng), []
    for finger in ("index", "middle", "ring", "little", "thumb"):
        below = "ring" if finger == "thumb" else finger
        off = CREASE_SD * rng.normal(size=3) + BESIDE * rng.normal(size=3)
        mark = body.roots[below] + setup.side * (CREASE + off)

        def missed(pads: Mapping[str, Array], f: str = finger, at: Array = mark) -> Array:
            return _missed(pads[f] - at, separation)

        angles = _solve_angles(setup, body, thick, "palm", (finger,), missed, into_palm=True)
        found.append(_Hold(f"{finger}_bottom-palm_{below}", angles))
    return found


HOLDS: Mapping[str, Callable[[Setup, Body, np.random.Generator, float], list[_Hold]]] = {
    "thumb on fingertips": _pinches,
    "table": _table,
    "palm": _palm,
}


def _missed(off: Array, separation: float) -> Array:
    """What is left (m) of a contact, or of a distance."""
    return np.array([np.linalg.norm(off) - separation]) if separation else off


def _thick(rng: np.random.Generator) -> dict[str, float]:
    return {f: m + THICK_SD * rng.normal() for f, m in THICK.items()}


def _solve_angles(
    setup: Setup,
    body: Body,
    thick: Mapping[str, float],
    kind: str,
    fingers: Sequence[str],
    missed: Callable[[Mapping[str, Array]], Array],
    straight_down: bool = False,
    into_palm: bool = False,
) -> dict[str, Array]:
    """Angles (3, 3) rad of all fingers: these reach, near to a guess, the others stay a little bent."""
    which = [0 if f == "thumb" else 1 for f in fingers]
    start, low, high = (
        DEG * np.concatenate([np.array(x[k], float) for k in which])
        for x in (GUESS[kind], LOW, HIGH)
    )
    start = np.clip(start, low + 1e-3, high - 1e-3)
    towards = setup.side * np.array([-1.0, 0.0, 0.0]) * (1 if straight_down else -1)

    def spread(x: Array) -> dict[str, Array]:
        found, k = {}, 0
        for f in fingers:
            count = 5 if f == "thumb" else 4
            found[f], k = _angles(f, x[k : k + count]), k + count
        return found

    def residual(x: Array) -> Array:
        angles = spread(x)
        ball = straight_down or into_palm
        pads = {
            f: _pad(setup, body, f, a, thick[f], towards if ball else None)
            for f, a in angles.items()
        }
        return np.concatenate([missed(pads) / 1e-4, 0.3 * (x - start)])

    reached = spread(least_squares(residual, start, bounds=(low, high), xtol=1e-12).x)
    rest = {f: _angles(f, DEG * np.array(GUESS["table"][f != "thumb"], float)) for f in CHAINS}
    return {**rest, **reached}


def _angles(finger: str, x: Array) -> Array:
    """Of the three joints (3, 3) from a finger's freedoms."""
    first = x[:3] if finger == "thumb" else np.array([x[0], x[1], 0.0])
    second, third = x[-2:]
    return np.array([first, [second, 0, 0], [third, 0, 0]])


def _pad(
    setup: Setup, body: Body, finger: str, angles: Array, thick: float, towards: Array | None
) -> Array:
    """The pad (3,) in the hand's frame from the wrist: below the bone's end, or of a ball about it in a direction."""
    R, end = np.eye(3), body.roots[finger]
    for segment, turn in zip(CHAINS[finger], angles):
        R = R @ _joint_rotations(turn[None])[0]
        end = end + R @ (setup.side * np.array([0.0, body.lengths[segment], 0.0]))
    below = R @ (setup.side * np.array([-1.0, 0.0, 0.0]))
    return np.asarray(end + thick * (below if towards is None else towards))
