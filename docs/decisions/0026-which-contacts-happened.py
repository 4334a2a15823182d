"""What contacts tell of how the hand's sensor sits, and what is said of it, where the movement is known exactly, in both simulators.

python docs/decisions/0026-which-contacts-happened.py FIRST_SEED LAST_SEED
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import (
    HandGeometry,
    HandMeasures,
    sized,
    with_finger_lengths,
)
from handscope.estimators.methods import map_contacts, map_unobserved
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.uncertainty import monte_carlo
from handscope.estimators.self_calibration.uncertainty.monte_carlo import DRAWS, Uncertainty
from handscope.estimators.simulation.movements import touched_fingertips, touched_surfaces
from handscope.estimators.simulation.scenario import simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from handscope.validation.independent.simulator import contacts
from handscope.validation.independent.simulator.free_movement import (
    DEG,
    JOINTS,
    Body,
    Setup,
    _body,
    _segment_poses,
)

ALL = tuple(contacts.HOLDS)
CASES = {
    "the other simulator, ten contacts that happened": (ALL, 0.0),
    "the other simulator, none of ten happened, 4 cm away": (ALL, 0.04),
    "the other simulator, none of ten happened, 2 cm away": (ALL, 0.02),
    "the other simulator, fingertips up to 4 cm above a table, alone": (("table",), 0.04),
}
OURS = {
    "our simulator, ten contacts that happened": 0.0,
    "our simulator, none of ten happened, 4 cm away": 0.04,
}
PARAMS = Params()
MOUNTING_SD = np.radians(PARAMS.mounting)
KNOWN_SD = 2e-4  # m, of lengths that movement tells

Told = tuple[
    Array, Array, int
]  # error and sd (3,) rad of the hand's mounting; contacts that were used


def measure(seed: int, kinds: tuple[str, ...], separation: float) -> Told:
    """A person of the other simulator, whose sensors sit as they do there."""
    setup = Setup(seed, fingers=FINGERS, forearm=True, pace=0.6, missed=2.5 * DEG)
    movement, held, until = contacts.with_contacts(setup, kinds, separation)
    body, t = _body(setup), np.arange(0.0, until, 0.05)
    off = {s: (body.mountings[s] * body.nominal[s].inv()).as_rotvec() for s in body.mountings}
    q_GS = np.full((len(t), len(SEGMENTS), 4), np.nan)
    for s, R, _ in _segment_poses(setup, body, movement, t):
        q_GS[:, SEGMENT[s]] = Rotation.from_matrix(R).as_quat(scalar_first=True)
    events = [Event(h.onset, h.end - h.onset, "contact", {"contacts": h.words}) for h in held]
    return _told(t, q_GS, off, _geometry(body), events)


def measure_ours(seed: int, separation: float) -> Told:
    """A person of our simulator."""
    rng, geometry = np.random.default_rng(seed), sized("left")
    lifts = {f: float(rng.uniform(0.0, separation)) for f in FINGERS}
    performances = (
        touched_fingertips.touch_fingertips(geometry, rng, missed=separation),
        touched_surfaces.fingertips_on_table(geometry, rng, lifts),
        touched_surfaces.fingertips_on_palm(geometry, rng, missed=separation),
    )
    found = simulate_performances(performances, "left", geometry, rng, IDEAL)
    off = {s: MOUNTING_SD * rng.normal(size=3) for s in SEGMENTS}
    return _told(found.truth.t, found.truth.q_GS.copy(), off, geometry, found.events)


def _told(
    t: Array,
    q_GS: Array,
    off: Mapping[str, Array],
    geometry: HandGeometry,
    events: Sequence[Event],
) -> Told:
    """What contacts tell where self-calibration finds this movement of the segments, but for the mountings that no movement shows."""
    turns = {"hand": off["hand"], **{c[-1]: off[c[-1]] * map_unobserved.Z for c in CHAINS.values()}}
    for s, turn in turns.items():
        q_GS[:, SEGMENT[s]] = quat.multiply(q_GS[:, SEGMENT[s]], quat.exp(turn))
    angles, tips = np.zeros((len(t), *IS_DOF.shape)), np.zeros((len(t), len(FINGERS), 3))
    moved = Trajectory("left", t, angles, q_GS, tips, np.zeros(q_GS.shape[:2], np.uint8))
    known = {s: KNOWN_SD for c in CHAINS.values() for s in c[:2]}
    calibration = initial_pose.uncalibrated("left", geometry, {}, ["hand"], 0.0)
    found = map_contacts.apply(
        PARAMS,
        moved,
        replace(calibration, lengths_sd=known),
        list(_fingers(moved)),
        held_contacts(events),
    )
    hand = found.fingers[0]
    left = quat.log(quat.multiply(hand.segments.q_BS["hand"], quat.exp(-turns["hand"])))
    return left, hand.sure.q_BS["hand"], sum(o.used for o in found.outcomes)


def _geometry(body: Body) -> HandGeometry:
    """As self-calibration has it: roots measured, all but the last phalanges from movement."""
    roots = {JOINTS[f][0]: tuple(p) for f, p in body.roots.items()}
    hand = sized("left", HandMeasures(palm_length=body.palm, joint_positions=roots))  # type: ignore[arg-type]
    for f in FINGERS:
        hand = with_finger_lengths(hand, f, {s: body.lengths[s] for s in CHAINS[f][:2]})
    return hand


def _fingers(moved: Trajectory) -> Iterator[Finger]:
    """Fingers of which all is known but how the hand's and the last sensors sit."""
    turns = MOUNTING_SD * monte_carlo.mounting_numbers()
    for name, chain in CHAINS.items():
        q_GB = {s: moved.q_GS[:, SEGMENT[s]] for s in ("hand", *chain)}
        none, last = np.zeros((DRAWS, 1, *IS_DOF.shape)), chain[-1]
        errors = {
            "hand": turns[:, SEGMENT["hand"]],
            last: turns[:, SEGMENT[last]] * map_unobserved.Z,
        }
        sure = Uncertainty(errors, {}, np.zeros(1, int), none, none[:, :, 0])
        segments = Segments(dict.fromkeys(q_GB, quat.IDENTITY), {}, {}, {}, q_GB)
        yield Finger(name, moved.t, SimpleNamespace(), segments, sure)  # type: ignore[arg-type]


if __name__ == "__main__":
    first, last = map(int, sys.argv[1:])
    measures = {case: partial(measure, kinds=k, separation=s) for case, (k, s) in CASES.items()}
    measures |= {case: partial(measure_ours, separation=s) for case, s in OURS.items()}
    for case, measured in measures.items():
        found = [measured(seed) for seed in range(first, last + 1)]
        error, sd = (np.array([f[k] for f in found]) for k in (0, 1))
        sys.stdout.write(
            f"{case}: error {np.sqrt((error**2).mean()) / DEG:.2f} deg, told {np.sqrt((sd**2).mean()) / DEG:.2f} deg, "
            f"normalised error squared {((error / sd) ** 2).mean():.2f}, {np.mean([f[2] for f in found]):.1f} contacts used\n"
        )
