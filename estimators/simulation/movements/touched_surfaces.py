"""Fingertips on a table, and one after the other on a mark in the palm, held still: contacts for calibration.

Source  pulp to palm as in clinics, ASSH; sizes of what people miss: ours
Limits  the forearm is level; a table is tilted as much as drawn; the mark lies beside where the model has it
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from handscope.estimators.data.events import Event
from handscope.estimators.data.fingertip_contacts import FINGERTIPS, palm_mark, pulp_offset
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FINGERS, JOINT, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, make_posture, move_through
from handscope.estimators.simulation.movements.grasp_postures import freedoms, tips_of
from handscope.estimators.simulation.movements.task_performance import Performance, relaxed

HELD, BETWEEN = 2.5, 1.2  # s
SETTLED = 0.2  # s at both ends of a hold that its event leaves out
PULP_SD = 0.0015  # m, of how far each pulp reaches below the model's
TILT_SD = np.radians(0.7)  # of the table, about each axis
HEIGHT = 0.06  # m, of the wrist's centre above the table
MARK_SD = 0.003  # m, each axis, of where the mark lies
PLACE_SD = 0.003  # m, each axis, of where on it a fingertip touches
ON_TABLE = {"mcp_flexion": 35.0, "pip_flexion": 40.0, "dip_flexion": 20.0}  # deg
IN_PALM = {"mcp_flexion": 70.0, "pip_flexion": 95.0, "dip_flexion": 55.0}
THUMB_ON_TABLE = {
    "thumb_cmc_flexion": 35.0,
    "thumb_cmc_deviation": -35.0,
    "thumb_cmc_pronation": 50.0,
    "thumb_mcp_flexion": 10.0,
    "thumb_ip_flexion": 10.0,
}
THUMB_IN_PALM = {
    "thumb_cmc_flexion": 35.0,
    "thumb_cmc_deviation": -10.0,
    "thumb_cmc_pronation": 85.0,
    "thumb_mcp_flexion": 30.0,
    "thumb_ip_flexion": 40.0,
}
ON_MARK_OF = {"thumb": "ring", **{f: f for f in FINGERS[1:]}}
CLENCHED = {"pip_flexion": 115.0, "dip_flexion": 90.0}  # deg, ranges of fingers that reach the palm
NEAREST = 0.3  # weight of a radian against 0.1 mm: postures stay near where they begin

NO_LIFT: Mapping[str, float] = {}


def fingertips_on_table(
    geometry: HandGeometry,
    rng: np.random.Generator,
    lifted: Mapping[str, float] = NO_LIFT,
    pulp_sd: float = PULP_SD,
    tilt_sd: float = TILT_SD,
    held: float = HELD,
    between: float = BETWEEN,
) -> Performance:
    """All fingertips on a table; those of `lifted` stay so far (m) above it all the same."""
    tilt, pulps = tilt_sd * rng.normal(size=2), pulp_sd * rng.normal(size=len(FINGERS))
    guess = make_posture(
        relaxed(),
        **{f"{f}_{name}": a for f in FINGERS[1:] for name, a in ON_TABLE.items()},
        **THUMB_ON_TABLE,
    )

    def height_above(finger: str, too_low: float, x: Array) -> Array:
        up, y, z = side_sign(geometry.hand) * lowest_point(x, geometry, finger, -_up(geometry))
        return np.array([up + HEIGHT - tilt @ (y, z) - too_low])

    posture = guess
    for finger, pulp in zip(FINGERS, pulps):
        above = lifted.get(finger, 0.0)
        posture = _solve_posture(posture, finger, partial(height_above, finger, pulp + above))
    words = " ".join(f"{f}_bottom-table_top" for f in FINGERS)
    return _held_in_turn([(words, posture)], held, between)


def fingertips_on_palm(
    geometry: HandGeometry,
    rng: np.random.Generator,
    fingers: Sequence[str] = (*FINGERS[1:], "thumb"),
    missed: float = 0.0,
    mark_sd: float = MARK_SD,
    place_sd: float = PLACE_SD,
    held: float = HELD,
    between: float = BETWEEN,
) -> Performance:
    """The tip of each finger on the mark in the palm below it, the thumb's on the little finger's; with `missed` (m) it stays so far below it all the same."""

    def beside(finger: str, place: Array, x: Array) -> Array:
        return lowest_point(x, geometry, finger, _up(geometry)) - place

    holds = []
    for finger in fingers:
        below = ON_MARK_OF[finger]
        mark = np.asarray(geometry.joint_positions[f"{below}_mcp"]) + palm_mark(geometry)
        off = mark_sd * rng.normal(size=3) + place_sd * rng.normal(size=3)
        place = mark + off - missed * _up(geometry)
        bent = (
            THUMB_IN_PALM
            if finger == "thumb"
            else {f"{finger}_{name}": a for name, a in IN_PALM.items()}
        )
        start = make_posture(relaxed(), **bent)
        posture = _solve_posture(start, finger, partial(beside, finger, place))
        holds.append((f"{finger}_bottom-palm_{below}", posture))
    return _held_in_turn(holds, held, between)


def lowest_point(x: Array, geometry: HandGeometry, finger: str, towards: Array) -> Array:
    """The pulp's farthest point (3,) in WCS in a direction (3,) of it, of a posture (54,) with a straight wrist."""
    q_pc = joint_angles.compose(x[6:].reshape(-1, 3))
    q = quat.IDENTITY
    for joint in FINGER_JOINTS[finger]:
        q = quat.multiply(q, q_pc[JOINT[joint]])
    skin, _ = pulp_offset(
        geometry, finger, quat.rotate(quat.conjugate(q), towards), FINGERTIPS[finger]
    )
    return np.asarray(tips_of(x, geometry)[FINGERS.index(finger)] + quat.rotate(q, skin))


def _up(geometry: HandGeometry) -> Array:
    """Dorsal, in the hand's frame."""
    return side_sign(geometry.hand) * np.array([1.0, 0.0, 0.0])


def _solve_posture(x: Array, finger: str, miss: Callable[[Array], Array]) -> Array:
    """The posture (54,) nearest to x, within natural joint ranges, in which a finger misses nothing (m)."""
    free = freedoms(finger)
    columns = np.array([COORDINATES[name] for name, _, _ in free])
    low, high = np.radians(
        [
            [a for _, a, _ in free],
            [max(b, CLENCHED.get(name.removeprefix(f"{finger}_"), b)) for name, _, b in free],
        ]
    )
    start = np.clip(x[columns], low + 1e-3, high - 1e-3)

    def posture(angles: Array) -> Array:
        y = x.copy()
        y[columns] = angles
        return y

    def residual(angles: Array) -> Array:
        return np.concatenate([miss(posture(angles)) / 1e-4, NEAREST * (angles - start)])

    return posture(least_squares(residual, start, bounds=(low, high), xtol=1e-12).x)


def _held_in_turn(holds: Sequence[tuple[str, Array]], held: float, between: float) -> Performance:
    """Postures (54,) held one after the other, relaxed between, each with its event of contacts."""
    points, events, t = [(0.0, relaxed())], [], 0.0
    for words, posture in holds:
        begin, end = t + between, t + between + held
        t = end + between
        points += [(begin, posture), (end, posture), (t, relaxed())]
        length = held - 2 * SETTLED
        events.append(Event(begin + SETTLED, length, "contact", {"contacts": words}))
    return Performance(move_through(points), tuple(events))
