"""Sensor-to-segment rotations that make every joint of the hand move as it can, from several
movements at once.

In      angular rates of all sensors on one time base for each movement, gravity in still postures,
        a first guess of every q_BS
Out     q_BS by segment with standard deviations; what each movement's first posture was off by
Source  ours: the thesis' dimension update (Kortier, (2.29)-(2.32)) for angular rates. The
        relative rate of two neighbours, turned by what the gyroscopes have integrated since the
        movement began, has no part about an axis that is no freedom of their joint. Gauss-Newton
        over small turns of all sensors; the posture each movement begins with is estimated along
Limits  a turn of a sensor about its segment's flexion axis is seen by gravity in the still postures
        only: there the posture's error stays. Soft tissue turns sensors by a share of the movement:
        a movement counts as `LOOKS` independent looks of that error, however many its samples
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import JOINTS, Hand, Joint, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
LOOKS = 6.0  # in one movement: there and back three times
FIRST = 5.0 * DEG  # sd of a joint's flexion where a movement begins: asked for straight; ours
ASIDE = 2.0 * DEG  # sd of an MCP joint's deviation there; ours
SEEN = 0.3 * DEG  # sd of gravity's direction in a sensor at rest: 0.05 m/s^2 of accelerometer bias
UNKNOWN = 30.0 * DEG  # sd of a first guess: sensors are put on up to 30 deg off
# times what soft tissue makes of the neighbours' movement: from here on a segment moved itself;
# ours
CLEAR = 4.0
STEADY = 0.005  # rad/s, rate that is noise
THINNED = 25.0  # Hz
ITERATIONS = 5


@dataclass(frozen=True)
class Movement:
    """All sensors' rates on one time base, biases removed."""

    dt: float
    rate: Mapping[str, Array]  # (n, 3) rad/s by segment, sensor frames


@dataclass(frozen=True)
class GravitySighting:
    """Gravity seen in a still posture by one sensor."""

    segment: str
    up_S: Array  # (3,) unit, sensor frame
    # what was to be held straight between what is known and the segment: its flexion misses by the
    # sum of what they miss
    held: tuple[str, ...]
    sd: float  # rad, that each of them misses
    roll_sd: float = 1.0 * DEG  # rad, of its turn about its long axis: fingers have no such freedom
    # (3,) seen by the hand's sensor in its frame; None: the posture lay level, x upright
    up_H: Array | None = None
    q_HB: Array | None = None  # (4,) the segment on the hand there


@dataclass(frozen=True)
class Fit:
    """Sensor-to-segment rotations with their covariance, rad^2."""

    q_BS: Mapping[str, Array]  # (4,)
    sd: Mapping[str, Array]  # (3,) rad about the segment's x, y, z
    covariance: Array  # (3 k, 3 k) rad^2, of all of them in that order

    def of(self, segments: Sequence[str]) -> Array:
        """Covariance of some of them."""
        order = list(self.sd)
        places = np.concatenate([np.arange(3) + 3 * order.index(s) for s in segments])
        return np.asarray(self.covariance[np.ix_(places, places)])


def fit(
    guess: Mapping[str, Array],
    movements: Sequence[Movement],
    sights: Sequence[GravitySighting],
    hand: Hand,
    soft_tissue: float,
) -> Fit:
    """Refine the guesses (4,) by segment; `soft_tissue`: turn of a sensor per turn of its
    segment."""
    places = {segment: np.arange(3 * k, 3 * k + 3) for k, segment in enumerate(guess)}
    thin = [_thin_out(m, list(guess), soft_tissue) for m in movements]
    joints = [j for j in JOINTS if j.parent in guess and j.child in guess and len(j.dofs) < 3]
    count = 3 * len(guess)
    first = {
        (m, j.name): np.arange(count + 2 * k, count + 2 * k + 2)
        for k, (m, j) in enumerate((m, j) for m in range(len(thin)) for j in joints)
    }
    count += 2 * len(first)
    looks = [s for s in sights if s.segment in guess]
    misses = {
        name: count + k
        for k, name in enumerate(dict.fromkeys(name for s in looks for name in s.held))
    }
    count += len(misses)
    q_BS, start = dict(guess), np.zeros(count)
    for _ in range(ITERATIONS):
        system = _System(count)
        for segment in guess:
            off = quat.log(quat.multiply(q_BS[segment], quat.conjugate(guess[segment])))
            system.add([places[segment]], [np.eye(3)], off, np.full(3, 1.0 / UNKNOWN))
        for sight in looks:
            _add_sighting(
                system,
                sight,
                q_BS,
                places,
                side_sign(hand),
                [misses[name] for name in sight.held],
                start,
            )
        for name, each in {name: s.sd for s in looks for name in s.held}.items():
            system.add(
                [np.array([misses[name]])],
                [np.eye(1)],
                start[[misses[name]]],
                np.array([1.0 / each]),
            )
        for (m, name), place in first.items():
            joint = next(j for j in joints if j.name == name)
            _add_relative_rates(
                system, thin[m], joint, q_BS, places, place, start[place], soft_tissue
            )
        step = system.solved()
        q_BS = {
            s: quat.normalize(quat.multiply(quat.exp(step[places[s]]), q)) for s, q in q_BS.items()
        }
        start += np.where(np.arange(count) >= 3 * len(guess), step, 0.0)
    covariance: Array = np.asarray(np.linalg.inv(system.normal), float)[
        : 3 * len(guess), : 3 * len(guess)
    ]
    sd = np.sqrt(np.diag(covariance))
    return Fit(q_BS, {s: np.asarray(sd[places[s]]) for s in guess}, covariance)


class _System:
    """Normal equations of weighted least squares."""

    def __init__(self, count: int) -> None:
        self.normal, self.right = np.zeros((count, count)), np.zeros(count)

    def add(
        self,
        columns: Sequence[NDArray[np.int_]],
        parts: Sequence[Array],
        residual: Array,
        weight: Array,
    ) -> None:
        """Rows `residual + sum(parts @ unknown) = 0`, each with its weight 1/sd."""
        J, c = np.concatenate(parts, axis=1) * weight[:, None], np.concatenate(columns)
        self.normal[np.ix_(c, c)] += J.T @ J
        self.right[c] -= J.T @ (residual * weight)

    def solved(self) -> Array:
        return np.asarray(np.linalg.solve(self.normal, self.right))


@dataclass(frozen=True)
class _ThinnedMovement:
    """A movement with fewer samples: rates and how far each sensor has turned since the
    beginning."""

    rate: Mapping[str, Array]  # (n, 3)
    turned: Mapping[str, Array]  # (n, 4) sensor at its beginning <- sensor now
    # segments that moved themselves; of the others it may have been soft tissue
    # of how the sensor sits
    clear: frozenset[str]


def _thin_out(movement: Movement, segments: Sequence[str], soft_tissue: float) -> _ThinnedMovement:
    every = max(1, round(1.0 / (THINNED * movement.dt)))
    seen = [s for s in segments if s in movement.rate]
    if not seen:
        return _ThinnedMovement({}, {}, frozenset())
    rate = {s: _means(movement.rate[s], every) for s in seen}
    turned = _integrate_rates(np.stack([movement.rate[s] for s in seen], axis=1), movement.dt)[
        every // 2 :: every
    ]
    size = {s: float(np.sqrt((r * r).sum(axis=1).mean())) for s, r in rate.items()}
    pairs = [(a, b) for j in JOINTS for a, b in ((j.parent, j.child), (j.child, j.parent))]
    clear = {
        s
        for s in seen
        if size[s]
        >= CLEAR
        * soft_tissue
        * max((size[b] for a, b in pairs if a == s and b in size), default=0.0)
    }
    return _ThinnedMovement(
        rate, {s: turned[: len(rate[s]), k] for k, s in enumerate(seen)}, frozenset(clear)
    )


def _means(rate: Array, every: int) -> Array:
    n = len(rate) // every
    return np.asarray(rate[: n * every].reshape(n, every, 3).mean(axis=1))


def _integrate_rates(rate: Array, dt: float) -> Array:
    """How far each sensor has turned since the beginning (n, sensors, 4), from rates (n, sensors,
    3)."""
    q = np.tile(quat.IDENTITY, (*rate.shape[:2], 1))
    turns = quat.exp(0.5 * (rate[1:] + rate[:-1]) * dt)
    for k, turn in enumerate(turns):
        q[k + 1] = quat.multiply(q[k], turn)
    return quat.normalize(q)


def _add_sighting(
    system: _System,
    sight: GravitySighting,
    q_BS: Mapping[str, Array],
    places: Mapping[str, NDArray[np.int_]],
    sign: float,
    misses: Sequence[int],
    found: Array,
) -> None:
    """Where up is in the segment: two components, across x. The first is turned by all that was
    missed from what is known to the segment."""
    up = quat.rotate(q_BS[sight.segment], sight.up_S)
    columns, parts = [places[sight.segment]], [-quat.skew(up)]
    if sight.up_H is None or sight.q_HB is None:
        expected = np.array([sign, 0.0, 0.0])
    else:
        R_BH = quat.matrix(quat.conjugate(sight.q_HB))
        on_hand = quat.rotate(q_BS["hand"], sight.up_H)
        expected = R_BH @ on_hand
        columns, parts = [*columns, places["hand"]], [*parts, R_BH @ quat.skew(on_hand)]
    across = _across(expected)  # the first direction is moved by flexion, the second by a roll
    bent, by_each = float(found[list(misses)].sum()), np.array([[1.0], [0.0]])
    columns, parts = (
        [*columns, *(np.array([m]) for m in misses)],
        [*(across @ p for p in parts), *(by_each for _ in misses)],
    )
    system.add(
        columns,
        parts,
        across @ (up - expected) + by_each[:, 0] * bent,
        1.0 / np.array([SEEN, sight.roll_sd]),
    )


def _across(up: Array) -> Array:
    """Two unit vectors (2, 3) across `up`: where a turn about z moves it, and the rest."""
    flexed = np.cross([0.0, 0.0, 1.0], up)
    flexed /= np.linalg.norm(flexed)
    return np.stack([flexed, np.cross(up, flexed)])


def _add_relative_rates(
    system: _System,
    seen: _ThinnedMovement,
    joint: Joint,
    q_BS: Mapping[str, Array],
    places: Mapping[str, NDArray[np.int_]],
    place: NDArray[np.int_],
    start: Array,
    soft_tissue: float,
) -> None:
    """The joint's relative rate about axes that are no freedom of it; unknown: both sensors' turns,
    flexion and deviation at the beginning."""
    hinge = len(joint.dofs) == 1
    system.add(
        [place], [np.eye(2)], start, 1.0 / np.array([FIRST, (0.1 * DEG if hinge else ASIDE)])
    )
    if joint.parent not in seen.rate or joint.child not in seen.rate:
        return
    w_p, w_c = (quat.rotate(q_BS[s], seen.rate[s]) for s in (joint.parent, joint.child))
    A_p, A_c = (
        quat.matrix(_on_segment(q_BS[s], seen.turned[s])) for s in (joint.parent, joint.child)
    )
    residual, jacobian = forbidden_rates(w_p, w_c, A_p, A_c, start, hinge)
    for k, segment in enumerate((joint.child, joint.parent)):
        if segment not in seen.clear:
            jacobian[..., 3 * k : 3 * k + 3] = 0.0
    size = float(np.sqrt((w_p * w_p).sum(axis=1).mean() + (w_c * w_c).sum(axis=1).mean()))
    weight = np.full(len(w_p), np.sqrt(LOOKS / len(w_p)) / (soft_tissue * size + STEADY))
    for r, J in zip(residual, jacobian):
        system.add([places[joint.child], places[joint.parent], place], [J], r, weight)


def forbidden_rates(
    w_p: Array, w_c: Array, A_p: Array, A_c: Array, start: Array, hinge: bool
) -> tuple[Array, Array]:
    """Relative rates that the joint does not permit (rows, n), and their derivatives (rows, n, 8).

    In: rates (n, 3) of parent and child in their segments' frames, what each has turned since the
    beginning (n, 3, 3), flexion and deviation there. The derivatives are by small turns of the
    child's sensor (3), of the parent's (3), by flexion and by deviation at the beginning.
    """
    R_start = quat.matrix(joint_angles.compose(np.array([start[0], start[1], 0.0])))
    back = np.swapaxes(A_c, -1, -2)
    # the parent's rate in its frame at the beginning ...
    at_start = np.einsum("nij,nj->ni", A_p, w_p)
    in_child = at_start @ R_start  # ... and in the child's there
    carried = np.einsum("nij,nj->ni", back, in_child)
    w_pc_c = w_c - carried
    z_c, x_c = R_start.T @ [0.0, 0.0, 1.0], np.array([1.0, 0.0, 0.0])
    by_start = np.stack(
        [np.einsum("nij,nj->ni", back, np.cross(e, in_child)) for e in (z_c, x_c)], axis=-1
    )
    by_child = quat.skew(carried) - quat.skew(w_c) - back @ quat.skew(in_child)
    by_parent = back @ R_start.T @ quat.skew(at_start)
    J = np.concatenate([by_child, by_parent, by_start], axis=-1)
    if hinge:
        return np.stack([w_pc_c[:, 0], w_pc_c[:, 1]]), np.stack([J[:, 0], J[:, 1]])
    R_pc = np.swapaxes(A_p, -1, -2) @ R_start @ A_c
    _, deviation, pronation = np.moveaxis(
        joint_angles.decompose(quat.from_matrix(R_pc))[..., None], -2, 0
    )
    turned = np.concatenate(  # the child's turn on its parent that each unknown makes, child frame
        [
            back - np.eye(3),
            back @ R_start.T @ (A_p - np.eye(3)),
            np.stack([back @ z_c, back @ x_c], axis=-1),
        ],
        axis=-1,
    )
    # that much more deviation
    more = np.cos(pronation) * turned[:, 0] + np.sin(pronation) * turned[:, 2]
    # a turn about the parent's z shows about y of a child that deviates
    t, w_z = (
        np.tan(deviation),
        w_pc_c[:, 2:],
    )
    return (w_pc_c[:, 1:2] - t * w_z)[None, :, 0], (
        J[:, 1] - t * J[:, 2] - (1 + t * t) * w_z * more
    )[None]


def _on_segment(q_BS: Array, turned: Array) -> Array:
    """The sensor's turns as those of its segment."""
    return quat.multiply(quat.multiply(q_BS, turned), quat.conjugate(q_BS))
