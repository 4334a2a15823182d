"""Where joints lie as the movement shows it, against where the hand that was declared has them: exchanged fingers, the other hand, bones of another size.

In      pairs of sensors (sensor_pairs.py), sensor-to-segment rotations, the declared geometry
Out     what the places say against the declaration, with the probability of such places if it were right
Source  ours; tests of one simple hypothesis against another: Neyman & Pearson 1933, Phil Trans A 231:289; sizes of errors that are known up to a factor: Student 1908, Biometrika 6:1
Limits  the hand has to turn for the knuckles to show, a finger to bend briskly for its bones to; where they do not, standard deviations are large and nothing is said
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours.common_joint import (
    Joint,
    place_covariances,
    scattered,
    systematic_errors,
)
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, side_sign
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import normal_sf, student_sf
from handscope.estimators.numerics.typing import Array

# m, dorsal, distal, ulnar: how joints of people's palms differ from the declared, and skin; ours
ROOT_SD = {"thumb": (0.012, 0.012, 0.012)} | dict.fromkeys(FINGERS[1:], (0.005, 0.005, 0.004))
SENSOR_SD = (0.006, 0.012, 0.004)  # m, the same of a sensor from the middle of its phalanx's back
OF_HAND_SENSOR = 0.5  # share of what joints of the hand with fingers err that the hand's sensor does, for all of them alike
UNKNOWN = 10.0  # m, standard deviation of a knuckle's place along an axis of which the movement tells nothing
HAND_SENSOR_SD = 0.05  # m, where on the hand its sensor sits
BONE_SD = 0.25  # of the length: skin that slides, seats that are tilted
LENGTH_SD, LENGTH_OFF = 0.08, 0.15  # of a declared length; less is not worth a question
LENGTH_KNOWN = 0.2  # of a length, standard deviation from which on the movement does not tell it
FITS = 0.01  # probability from which on a hypothesis is compatible with what was seen
FREE = 4  # of the knuckles' coordinates: where the hand's sensor sits, and the difference that an exchange makes
FALSE_ALARM = 2e-4  # of all exchanges of two fingers in one recording, as of every family of check_neighbours.py


@dataclass(frozen=True)
class Bone:
    """A segment between its joints, along the declared distal direction: negative where it points the other way."""

    segment: str
    length: float  # m
    sd: float  # m
    declared: float  # m


@dataclass(frozen=True)
class Verdict:
    """A declaration that the places contradict."""

    kind: str  # "fingers", "side", "positions", "hand", "unknown"
    fingers: tuple[str, ...]
    p_value: float
    is_only: bool  # nothing else that was asked fits as well


@dataclass(frozen=True)
class Roots:
    """Where the chains begin, in the hand's frame from its sensor."""

    fingers: tuple[str, ...]
    place: Array  # (F, 3) m
    covariance: Array  # (3 F, 3 F) m^2, of one finger after the other


def roots(pairs: Pairs) -> Roots | None:
    """Of the fingers whose proximal sensor, like the hand's, has samples; None of fewer than two. Where a finger turns with the hand, by where on its phalanx its sensor sits."""
    names = pairs.series.sensors
    fingers = tuple(f for f in FINGERS if CHAINS[f][0] in names) if "hand" in names else ()
    if len(fingers) < 2:
        return None
    children = [CHAINS[f][0] for f in fingers]
    joints = [pairs.joint("hand", c) for c in children]
    found, covariance = np.array([j.place for j in joints]), _covariance(joints)
    at_hand = np.arange(6 * len(fingers)).reshape(-1, 6)[:, :3].ravel()
    at_finger = at_hand + 3
    declared = [pairs.expected("hand", c, ("hand", c)).centre[3:] for c in children]
    turned = _diagonal([quat.matrix(quat.conjugate(pairs.q_BS[c])) for c in children])
    of_sensor = turned @ np.diag(np.tile(SENSOR_SD, len(children))) ** 2 @ turned.T
    of_finger = covariance[np.ix_(at_finger, at_finger)] + of_sensor
    gain = np.linalg.solve(of_finger, covariance[at_finger][:, at_hand]).T
    place = found[:, :3].ravel() + gain @ (np.concatenate(declared) - found[:, 3:].ravel())
    rest = covariance[np.ix_(at_hand, at_hand)] - gain @ covariance[np.ix_(at_finger, at_hand)]
    R = _diagonal([quat.matrix(pairs.q_BS["hand"])] * len(fingers))
    return Roots(fingers, (R @ place).reshape(-1, 3), R @ rest @ R.T)


def exchanged_fingers(seen: Roots, geometry: HandGeometry) -> Verdict | None:
    """Long fingers that are probably on each other's places: two, or as many as an order of all of them moves.

    Returns
    -------
    Verdict or None
        `fingers`, where the knuckles are not as declared, and are as they would be in another order; that which fits best.
    """
    fitting = [t for t in _order_tests(seen, geometry) if t.fits > FITS]
    p_value = min((t.p_value for t in fitting), default=1.0)
    if p_value >= FALSE_ALARM:
        return None
    best = min(fitting, key=lambda t: float(np.sum(t.left**2)))
    is_only = all(_towards(best.left, t.left)[1] < FITS for t in fitting if t is not best)
    return Verdict("fingers", best.fingers, p_value, is_only)


def untested_fingers(seen: Roots, geometry: HandGeometry) -> tuple[str, ...]:
    """Long fingers of which two could be on each other's place without being found."""
    two = [t for t in _order_tests(seen, geometry) if len(t.fingers) == 2]
    unseen = {f for t in two if t.p_value_of_it >= FALSE_ALARM for f in t.fingers}
    return tuple(f for f in FINGERS if f in unseen)


@dataclass(frozen=True)
class _OrderTest:
    """Fingers, asked whether they are on each other's places: probabilities by Student's distribution."""

    fingers: tuple[str, ...]  # that another order moves
    left: Array  # what that order leaves of the knuckles' places, in standard deviations
    p_value: float  # that the knuckles of fingers in the declared order lie so
    fits: float  # that those of fingers in this one do
    p_value_of_it: float  # the first, if they were where this order has them


def _order_tests(seen: Roots, geometry: HandGeometry) -> list[_OrderTest]:
    """Every order of the long fingers: how large the errors of their knuckles' places are is learnt from what is off in all directions but that to the order's. Two fingers are half of the tests."""
    long = [k for k, f in enumerate(seen.fingers) if f != "thumb"]
    if 3 * len(long) <= FREE:
        return []
    rows = (3 * np.array(long)[:, None] + np.arange(3)).ravel()
    fingers = tuple(seen.fingers[k] for k in long)
    of_long = Roots(fingers, seen.place[long], seen.covariance[np.ix_(rows, rows)])
    declared = np.array([geometry.joint_positions[root_joint(f)] for f in fingers])
    own, orders = _misfit(of_long, declared), list(itertools.permutations(range(len(long))))[1:]
    moved = [tuple(k for k, other in enumerate(order) if k != other) for order in orders]
    two = sum(len(m) == 2 for m in moved)
    tests = []
    for order, move in zip(orders, moved):
        left = _misfit(of_long, declared[list(order)])
        p, fits, of_it = _towards(own, left)
        count = 2 * (two if len(move) == 2 else len(orders) - two)
        names = tuple(fingers[k] for k in move)
        tests.append(_OrderTest(names, left, count * p, fits, count * of_it))
    return tests


def _towards(own: Array, other: Array) -> Array:
    """Probabilities (3,) that knuckles lie so far from one description towards another, so far from the other, and where the other has them if the first is true; how large errors are is learnt from all
    other directions."""
    towards, freedom = own - other, len(own) - FREE
    whole = max(float(np.linalg.norm(towards)), 1e-12)
    off = float(own @ towards) / whole
    size = np.sqrt(max(float(own @ own) - off**2, 1e-12) / freedom)
    return student_sf(np.array([off, whole - off, whole]) / size, freedom)


def _covariance(joints: Sequence[Joint]) -> Array:
    """Of the places (6 F, 6 F) m^2 of the hand's joints with its fingers, one after the other: its sensor errs alike for all of them."""
    of_first, of_second = systematic_errors(joints, UNKNOWN)
    shared = np.concatenate(of_first)
    alone = scattered(joints) + of_second
    own = (1 - OF_HAND_SENSOR) * of_first @ np.swapaxes(of_first, 1, 2)
    return OF_HAND_SENSOR * shared @ shared.T + _diagonal(alone + own)


def _diagonal(blocks: Sequence[Array] | Array) -> Array:
    """Blocks (B, n, n) along the diagonal of a matrix (B n, B n)."""
    count, size = np.shape(blocks)[:2]
    whole = np.zeros((count, size, count, size))
    whole[np.arange(count), :, np.arange(count)] = blocks
    return whole.reshape(count * size, count * size)


def bones(pairs: Pairs, geometry: HandGeometry) -> list[Bone]:
    """Segments with a sensor on either side of both their joints."""
    found, joints = [], pairs.joints
    for chain in CHAINS.values():
        for parent, segment, child in zip(("hand", *chain), chain, chain[1:]):
            if (parent, segment) in joints and (segment, child) in joints:
                near, far = pairs.joint(parent, segment), pairs.joint(segment, child)
                R = side_sign(geometry.hand) * quat.matrix(pairs.q_BS[segment])
                of_near, of_far = place_covariances([near, far])
                covariance = R @ (of_near[3:, 3:] + of_far[:3, :3]) @ R.T
                along = float((R @ (far.place[:3] - near.place[3:]))[1])
                found.append(
                    Bone(
                        segment, along, float(np.sqrt(covariance[1, 1])), geometry.lengths[segment]
                    )
                )
    return found


def judge(seen: Roots | None, along: list[Bone], geometry: HandGeometry) -> Verdict | None:
    """What knuckles and bones say against the declared hand, if anything.

    Returns
    -------
    Verdict or None
        `fingers`: two whole fingers are exchanged; `side`: thumb and little finger are on each other's side; `positions`: the joint positions are the other hand's;
        `hand`: bones and knuckles point the other way round, as on the other hand; `unknown`: nothing that was asked fits.
    """
    backward, p_bones = _bones_reversed(along)
    if seen is None:
        return Verdict("hand", (), p_bones, True) if backward else None
    declared = np.array([geometry.joint_positions[root_joint(f)] for f in seen.fingers])
    hypotheses = _hypotheses(seen.fingers, declared)
    misfit = [float(np.sum(_misfit(seen, place) ** 2)) for _, _, place in hypotheses]
    kind, fingers, place = hypotheses[int(np.argmin(misfit))]
    p = (
        min(1.0, _p_value(seen, declared, place) * len(hypotheses))
        if min(misfit) < np.sum(_misfit(seen, declared) ** 2)
        else 1.0
    )
    if backward:
        return Verdict("hand", (), p_bones, True)
    is_only = all(
        _p_value(seen, other, place) < FITS for k, _, other in hypotheses if other is not place
    )
    return Verdict(kind, fingers, p, is_only)


def _hypotheses(
    fingers: tuple[str, ...], declared: Array
) -> list[tuple[str, tuple[str, ...], Array]]:
    found: list[tuple[str, tuple[str, ...], Array]] = [
        ("fingers", (fingers[a], fingers[b]), place) for a, b, place in _exchanges(declared)
    ]
    return [*found, ("side", (), declared * [1.0, 1.0, -1.0]), ("positions", (), -declared)]


def _exchanges(declared: Array) -> Iterator[tuple[int, int, Array]]:
    """Every two of some places (F, 3), and all places after their exchange."""
    for a, b in itertools.combinations(range(len(declared)), 2):
        order = np.arange(len(declared))
        order[[a, b]] = b, a
        yield a, b, declared[order]


def _whitened(seen: Roots, place: Array) -> Array:
    """What is left (3 F,) of the places, in standard deviations, the place of the hand's sensor being free."""
    F = len(seen.fingers)
    own = np.concatenate([ROOT_SD[finger] for finger in seen.fingers])
    covariance = seen.covariance + np.diag(own**2)
    covariance += HAND_SENSOR_SD**2 * np.kron(np.ones((F, F)), np.eye(3))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), (seen.place - place).ravel()))


def _centred(seen: Roots, place: Array) -> Array:
    """Places from a sensor in the middle of the hand, where it usually sits."""
    return np.asarray(place - place.mean(axis=0) * [0.0, 0.5, 0.0])


def _misfit(seen: Roots, place: Array) -> Array:
    return _whitened(seen, _centred(seen, place))


def _p_value(seen: Roots, true: Array, other: Array) -> float:
    """Probability that other places fit so much better although some are true."""
    own, their = _misfit(seen, true), _misfit(seen, other)
    gain, expected = float(own @ own - their @ their), float(np.sum((own - their) ** 2))
    return float(normal_sf((gain + expected) / (2 * np.sqrt(expected) + 1e-12)))


def _bones_reversed(along: list[Bone]) -> tuple[bool, float]:
    """Whether all bones together point the other way, and the probability of that if they do not."""
    sd = np.array([np.hypot(b.sd, BONE_SD * b.declared) for b in along])
    length, declared = np.array([b.length for b in along]), np.array([b.declared for b in along])
    if not len(along):
        return False, 1.0
    expected = float(np.sum((2 * declared / sd) ** 2))
    gain = float(np.sum(((length - declared) / sd) ** 2 - ((length + declared) / sd) ** 2))
    p = float(normal_sf((gain + expected) / (2 * np.sqrt(expected))))
    return gain > 0 and float(normal_sf(-(gain - expected) / (2 * np.sqrt(expected)))) > FITS, p


def odd_lengths(along: list[Bone]) -> list[tuple[Bone, float]]:
    """Bones that are longer or shorter than declared, with the probability of such a length if they were not."""
    found = []
    for bone in along:
        sd = float(np.hypot(bone.sd, LENGTH_SD * bone.declared))
        p = float(2 * normal_sf(abs(bone.length - bone.declared) / sd)) * len(along)
        if (
            abs(bone.length - bone.declared) > LENGTH_OFF * bone.declared
            and bone.sd < LENGTH_KNOWN * bone.declared
        ):
            found.append((bone, min(1.0, p)))
    return found
