"""Where joints lie as the movement shows it, against where the hand that was declared has them: exchanged fingers, the other hand, bones of another size.

In      pairs of sensors (sensor_pairs.py), sensor-to-segment rotations, the declared geometry
Out     what the places say against the declaration, with the probability of such places if it were right
Source  ours; tests of one simple hypothesis against another: Neyman & Pearson 1933, Phil Trans A 231:289
Limits  the hand has to turn for the knuckles to show, a finger to bend briskly for its bones to; where they do not, standard deviations are large and nothing is said
"""

import itertools
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours.common_joint import place_covariances
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, side_sign
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

ROOT_SD = {"thumb": 0.012} | dict.fromkeys(
    FINGERS[1:], 0.005
)  # m, each axis: how joints of people's palms differ from the declared, and skin; ours
HAND_SENSOR_SD = 0.05  # m, where on the hand its sensor sits
BONE_SD = 0.25  # of the length: skin that slides, seats that are tilted
LENGTH_SD, LENGTH_OFF = 0.08, 0.15  # of a declared length; less is not worth a question
LENGTH_KNOWN = 0.2  # of a length, standard deviation from which on the movement does not tell it
FITS = 0.01  # probability from which on a hypothesis is compatible with what was seen


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
    covariance: Array  # (F, 3, 3) m^2


def roots(pairs: Pairs) -> Roots | None:
    """Of the fingers whose proximal sensor, like the hand's, has samples; None of fewer than two."""
    names = pairs.series.sensors
    fingers = tuple(f for f in FINGERS if CHAINS[f][0] in names) if "hand" in names else ()
    if len(fingers) < 2:
        return None
    R = quat.matrix(pairs.q_BS["hand"])
    joints = [pairs.joint("hand", CHAINS[f][0]) for f in fingers]
    return Roots(
        fingers,
        np.array([R @ j.place[:3] for j in joints]),
        R @ place_covariances(joints)[:, :3, :3] @ R.T,
    )


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
    found: list[tuple[str, tuple[str, ...], Array]] = []
    for a, b in itertools.combinations(range(len(fingers)), 2):
        order = np.arange(len(fingers))
        order[[a, b]] = b, a
        found.append(("fingers", (fingers[a], fingers[b]), declared[order]))
    return [*found, ("side", (), declared * [1.0, 1.0, -1.0]), ("positions", (), -declared)]


def _whitened(seen: Roots, place: Array) -> Array:
    """What is left (3 F,) of the places, in standard deviations, the place of the hand's sensor being free."""
    F = len(seen.fingers)
    covariance = np.zeros((3 * F, 3 * F))
    for k, finger in enumerate(seen.fingers):
        covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = seen.covariance[k] + ROOT_SD[
            finger
        ] ** 2 * np.eye(3)
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
