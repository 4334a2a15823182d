"""What a hand does after its initial pose, by closed formulas: twelve movements, and the same of tired, stiff and trembling hands.

Out     movements of free_movement.py, of which readings and truth are made there
Source  fingers close almost together, DIP by about half to one of PIP: Santello et al. 1998, J Neurosci 18:10105; tremor 4 to 6 Hz at rest, 6 to 10 Hz held out:
        Deuschl et al. 1998, Mov Disord 13 Suppl 3; sizes and durations ours
Limits  nothing is touched: what is held, or tapped on, stops no finger
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handscope.validation.independent.simulator.free_movement import (
    BEGUN,
    CHAINS,
    DEG,
    Movement,
    Setup,
    after_pose,
    free,
)

Array = NDArray[np.float64]
Course = Callable[[Array], Array]  # of the time (n,) s
FINGERS = ("index", "middle", "ring", "little")
SPREAD = 0.02  # s, standard deviation of when fingers that move together begin
SHAKY = 1.5e-3, 0.15 * DEG  # m, rad: nobody holds a hand quite still, standard deviations


@dataclass(frozen=True)
class Hand:
    """Shares of closing by finger, (n,) from 0 flat to 1 fist, of a relaxed hand 0.3; the thumb's of opposing; wrist and place."""

    closing: Mapping[str, Course]
    turns: Course  # (n, 3) rad, of the hand about its z, x, y from palm down
    wanders: Course  # (n, 3) m


def movement(name: str, setup: Setup) -> Movement:
    """One of MOVEMENTS by the person of a set-up, from an initial pose on."""
    rng = np.random.default_rng([setup.seed, list(MOVEMENTS).index(name), 1998])
    made = MOVEMENTS[name](rng, setup)
    return after_pose(
        setup, setup.missed or 0.0, made if isinstance(made, Movement) else _angles(rng, made)
    )


def _angles(rng: np.random.Generator, hand: Hand) -> Movement:
    """Joint angles of a hand: each person's and each finger's own shares of MCP, PIP and DIP."""
    full = {f: DEG * rng.normal((70, 90, 50), (6, 7, 14)) for f in FINGERS}
    spread = {f: rng.normal(0.0, 4 * DEG) for f in FINGERS}
    thumb = DEG * rng.normal(((25, -25, 15), (35, 0, 0), (40, 0, 0)), (4.0, 3.0, 3.0))

    def finger(f: str, t: Array) -> Array:
        share = hand.closing[f](t)
        out = np.zeros((len(t), 3, 3))
        out[:, :, 0] = np.maximum(share, -0.1)[:, None] * full[f]
        out[:, 0, 1] = spread[f] * (1 - share)
        return out

    def of_thumb(t: Array) -> Array:
        return hand.closing["thumb"](t)[:, None, None] * thumb * [[1, 1, 1], [1, 0, 0], [1, 0, 0]]

    def turns(t: Array) -> Array:
        z, x, y = hand.turns(t).T
        about = [
            Rotation.from_rotvec(a[:, None] * np.eye(3)[k]) for k, a in ((2, z), (0, x), (1, y))
        ]
        return np.asarray((about[0] * about[1] * about[2]).as_matrix())

    angles = {f: (lambda t, f=f: finger(f, t)) for f in FINGERS} | {"thumb": of_thumb}
    return Movement(angles, lambda t: np.zeros((len(t), 3)), turns, hand.wanders)


def _slow(rng: np.random.Generator, n: int, size: float) -> Course:
    """Sway (n,) of a hand that is held: sines below 1 Hz and a physiological tremor of 9 Hz."""
    f = rng.uniform(0.1, 0.9, (4, n))
    f[3] = rng.uniform(8, 11, n)
    share, phase = np.array([0.7, 0.5, 0.5, 0.03])[:, None], rng.uniform(0, 2 * np.pi, (4, n))
    return lambda t: np.asarray(
        size * (share * np.sin(2 * np.pi * f * t[:, None, None] + phase)).sum(axis=1)
    )


def _held(rng: np.random.Generator) -> dict[str, Course]:
    return {"turns": _slow(rng, 3, SHAKY[1]), "wanders": _slow(rng, 3, SHAKY[0])}


def _swaying(rng: np.random.Generator, level: float, size: float) -> Course:
    sway = _slow(rng, 1, size)
    return lambda t: level + sway(t)[:, 0]


def _relaxed_hand(rng: np.random.Generator) -> dict[str, Course]:
    """Every finger as it hangs, and sways a little."""
    return {f: _swaying(rng, rng.normal(0.3, 0.05), 0.003) for f in CHAINS}


def _sum(*courses: tuple[float, Course]) -> Course:
    return lambda t: np.asarray(sum(share * course(t) for share, course in courses))


def _cycles(rng: np.random.Generator, hz: float) -> Course:
    """A phase (n,) rad that goes at about so many turns a second, never quite evenly."""
    own, drift = hz * rng.uniform(0.85, 1.15), rng.uniform(0, 2 * np.pi)
    return lambda t: 2 * np.pi * own * (t - BEGUN) + 0.5 * np.sin(2 * np.pi * 0.13 * t + drift)


def _wave(phase: Course, late: float, level: float, size: float) -> Course:
    return lambda t: level + size * np.sin(phase(t - late))


def _together(
    rng: np.random.Generator, fingers: Sequence[str], hz: float, least: float, most: float
) -> dict[str, Course]:
    """Fingers that open and close, almost at once."""
    made, phase = _relaxed_hand(rng), _cycles(rng, hz)
    for f in fingers:
        late, size = rng.normal(0.0, SPREAD), 0.5 * (most - least) * rng.uniform(0.9, 1.05)
        made[f] = _wave(phase, late, least + size, size)
    return made


def _tapping(rng: np.random.Generator, setup: Setup) -> Hand:
    return Hand(_together(rng, ("thumb", "index"), 2.5, 0.2, 0.6), **_held(rng))


def _open_close(rng: np.random.Generator, setup: Setup) -> Hand:
    return Hand(_together(rng, tuple(CHAINS), 1.2, 0.0, 0.9), **_held(rng))


def _slow_fist(rng: np.random.Generator, setup: Setup) -> Hand:
    return Hand(_together(rng, tuple(CHAINS), 0.25, 0.0, 1.0), **_held(rng))


def _fast_fist(rng: np.random.Generator, setup: Setup) -> Hand:
    return Hand(_together(rng, tuple(CHAINS), 2.5, 0.1, 0.6), **_held(rng))


def _one_by_one(rng: np.random.Generator, setup: Setup) -> Hand:
    """Each finger in turn, the neighbours coming along a little."""
    relaxed, order, long = _relaxed_hand(rng), list(CHAINS), 1.6
    bumps = []
    for k in range(len(order)):
        turn = np.arange(k, 60, len(order), dtype=float) + rng.uniform(-0.1, 0.1)
        bumps.append(_bumps(BEGUN + 0.5 + long * turn, 0.8 * long))
    made = {}
    for k, f in enumerate(order):
        near = [(0.06, bumps[j]) for j in (k - 1, k + 1) if 0 <= j < len(order)]
        made[f] = _sum((1.0, relaxed[f]), (0.5, bumps[k]), *near)
    return Hand(made, **_held(rng))


def _drumming(rng: np.random.Generator, setup: Setup) -> Hand:
    """Fingers on a table one after the other."""
    made, gap = _relaxed_hand(rng), rng.uniform(0.09, 0.16)
    for k, f in enumerate(("little", "ring", "middle", "index")):
        starts = BEGUN + 0.3 + 0.9 * np.arange(60.0) + gap * k
        made[f] = _sum((1.0, made[f]), (0.25, _bumps(starts, 0.35)))
    return Hand(made, **_held(rng))


def _bumps(starts: Array, long: float) -> Course:
    def course(t: Array) -> Array:
        u = np.clip((t[:, None] - starts) / long, 0.0, 1.0)
        return np.asarray((16 * u**2 * (1 - u) ** 2).sum(axis=1))

    return course


def _opposing(rng: np.random.Generator, setup: Setup) -> Hand:
    """The thumb to every finger in turn."""
    made, long = _relaxed_hand(rng), 1.4
    every = BEGUN + 0.5 + long * np.arange(60.0)
    for k, f in enumerate(FINGERS):
        made[f] = _sum((1.0, made[f]), (0.35, _bumps(every[k::4], long)))
    made["thumb"] = _sum((1.0, made["thumb"]), (0.7, _bumps(every, long)))
    return Hand(made, **_held(rng))


def _turning(axis: int, size: float, hz: float) -> Callable[[np.random.Generator, Setup], Hand]:
    def make(rng: np.random.Generator, setup: Setup) -> Hand:
        phase, sway, reach = _cycles(rng, hz), _slow(rng, 3, SHAKY[1]), size * rng.uniform(0.8, 1.1)
        return Hand(
            _relaxed_hand(rng),
            lambda t: sway(t) + reach * np.sin(phase(t))[:, None] * np.eye(3)[axis],
            _slow(rng, 3, 5e-3),
        )

    return make


def _reaching(rng: np.random.Generator, setup: Setup) -> Hand:
    """To things and back, the hand opening on the way and closing there."""
    phase, to = _cycles(rng, 0.4), rng.normal((0.25, 0.05, 0.12), 0.04)
    turned, sway = DEG * rng.normal((0, 20, 30), 8), _slow(rng, 3, SHAKY[1])

    def there(t: Array) -> Array:
        return np.asarray(((1 - np.cos(phase(t))) / 2)[:, None])

    closing = {
        f: _wave(lambda t: phase(t) - 0.8, rng.normal(0.0, SPREAD), 0.25, 0.25) for f in CHAINS
    }
    return Hand(closing, lambda t: sway(t) + there(t) * turned, lambda t: there(t) * to)


def _resting(rng: np.random.Generator, setup: Setup) -> Hand:
    return Hand(_relaxed_hand(rng), **_held(rng))


def _held_object(rng: np.random.Generator, setup: Setup) -> Hand:
    """Closed about a thing that is carried and turned."""
    closing = {f: _swaying(rng, rng.normal(0.5, 0.04), 0.006) for f in CHAINS}
    return Hand(closing, _slow(rng, 3, 18 * DEG), _slow(rng, 3, 0.05))


def _trembling(hz: float, size: float) -> Callable[[np.random.Generator, Setup], Hand]:
    def make(rng: np.random.Generator, setup: Setup) -> Hand:
        relaxed, phase, closing = _relaxed_hand(rng), _cycles(rng, hz), {}
        for f in CHAINS:
            late = rng.uniform(-0.6, 0.6) / (2 * np.pi * hz)
            trembles = _wave(phase, late, 0.0, size * rng.uniform(0.4, 1.0))
            closing[f] = _sum((1.0, relaxed[f]), (1.0, trembles))
        sway = _slow(rng, 3, SHAKY[1])
        return Hand(
            closing,
            lambda t: sway(t) + 0.8 * size * np.sin(phase(t))[:, None] * [0.5, 0.2, 1.0],
            _slow(rng, 3, SHAKY[0]),
        )

    return make


def _stiff(share: float) -> Callable[[np.random.Generator, Setup], Hand]:
    def make(rng: np.random.Generator, setup: Setup) -> Hand:
        hand = _open_close(rng, setup)

        def less(course: Course) -> Course:
            return lambda t: 0.3 + share * (course(t) - 0.3)

        return replace(hand, closing={f: less(c) for f, c in hand.closing.items()})

    return make


MOVEMENTS: Mapping[str, Callable[[np.random.Generator, Setup], Hand | Movement]] = {
    "free": lambda rng, setup: free(setup),
    "tapping": _tapping,
    "open and close": _open_close,
    "slow fist": _slow_fist,
    "fast fist": _fast_fist,
    "one by one": _one_by_one,
    "drumming": _drumming,
    "opposing": _opposing,
    "forearm turned": _turning(1, 60 * DEG, 0.8),
    "wrist": _turning(2, 35 * DEG, 0.6),
    "reaching": _reaching,
    "resting": _resting,
    "object held": _held_object,
    "tremor at rest": _trembling(5.0, 0.03),
    "tremor held out": _trembling(8.0, 0.015),
    "stiff": _stiff(0.3),
}
