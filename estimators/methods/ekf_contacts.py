"""Two points of fingertips that touch: a measurement of both chains' joints and mounting.

In      a hand's chains, its geometry with the covariance of its lengths, which points are held together or how far apart
Out     corrected chains and lengths, or the same where the contact is refused: farther off than errors explain
Source  closed chains as of Salchow-Hoemmen 2019, 3.2, P1 to P4, there to judge, here to measure. The covariances between two chains, and with
        the lengths, that the update makes are not kept, as between chains everywhere here; the gate is the chi-squared test of the innovation
Limits  used once a contact, as places on the skin stay while it is held
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, offset
from handscope.estimators.data.held_contact import ContactOutcome, HeldContact
from handscope.estimators.finger_ekf.filter import State
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE, joint_jacobian_row
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.tail_probabilities import chi2_sf
from handscope.estimators.numerics.typing import Array

REFUSED = 1e-3  # probability of such an innovation if they touch
LATE = 0.75  # share of a hold after which it counts: both fingers have come to rest


@dataclass(frozen=True)
class Updated:
    """What is known after a contact."""

    chains: State
    geometry: HandGeometry
    of_lengths: Array  # (5, 6, 6) covariance of the lengths: hand/length_covariance.py
    outcome: ContactOutcome


class Side(NamedTuple):
    """One of the two fingers: derivatives of the vector from the other's point to this one's."""

    finger: str
    by_joints: Array  # (m, 43) by the errors of its chain
    by_lengths: Array  # (m, 6) by those of its lengths


def due(held: HeldContact) -> float:
    """When a contact is to be used, s."""
    return held.onset + LATE * (held.end - held.onset)


def apply(
    chains: State, held: HeldContact, geometry: HandGeometry, of_lengths: Array, contact_sd: float
) -> Updated:
    """What is known after a contact of places known to `contact_sd` (m, each axis), and what became of it."""
    contact = held.contact
    if not chains.known[[FINGERS.index(f) for f, _ in (contact.a, contact.b)]].all():
        return Updated(chains, geometry, of_lengths, ContactOutcome(held, False, np.nan))
    sides, between, S = [], np.zeros(3), contact_sd**2 * np.eye(3)
    for sign, (finger, point) in ((1.0, contact.a), (-1.0, contact.b)):
        place, side = _side(chains, geometry, finger, point, sign)
        sides.append(side)
        between = between + sign * place
        S = S + _variance(side, chains, of_lengths)
    innovation = -between
    if contact.distance:  # along the line between the points only
        distance = float(np.linalg.norm(between))
        along = between[None] / distance
        innovation, S = np.array([contact.distance - distance]), along @ S @ along.T
        sides = [Side(s.finger, along @ s.by_joints, along @ s.by_lengths) for s in sides]
    weighed = np.asarray(np.linalg.solve(S, innovation))
    used = bool(chi2_sf(innovation @ weighed, len(innovation)) > REFUSED)
    outcome = ContactOutcome(held, used, float(np.linalg.norm(innovation)))
    if not used:
        return Updated(chains, geometry, of_lengths, outcome)
    corrected, of_lengths = chains, of_lengths.copy()
    for side in sides:
        f = FINGERS.index(side.finger)
        lengths_H = of_lengths[f] @ side.by_lengths.T
        geometry = _resized(geometry, side.finger, lengths_H @ weighed)
        of_lengths[f] -= lengths_H @ np.linalg.solve(S, lengths_H.T)
        corrected = _corrected(corrected, f, side.by_joints, S, weighed)
    return Updated(corrected, geometry, of_lengths, outcome)


def _side(
    chains: State, geometry: HandGeometry, finger: str, point: str, sign: float
) -> tuple[Array, Side]:
    """The point (3,) m in the hand's frame, and its derivatives."""
    f = FINGERS.index(finger)
    q, A = np.empty((3, 4)), np.zeros((9, SIZE))
    _fill_joints(
        *(np.array(x[f]) for x in (chains.q_pc, chains.q_SB, chains.soft_tissue_gain)), q, A
    )
    offsets = geometry.chain_offsets()[f].copy()
    offsets[-1] += offset(geometry, finger, point, FINGERTIPS[finger])
    bones, J = _point(q, geometry.roots()[f], offsets)
    by_lengths = np.hstack([np.eye(3), bones[1:].T])
    return bones.sum(axis=0), Side(finger, sign * J @ A, sign * by_lengths)


def _point(q_pc: Array, root: Array, offsets: Array) -> tuple[Array, Array]:
    """A chain's bones (4, 3) in the hand's frame, from wrist to point, and the derivative (3, 9) of the point by errors d of its joints, q exp(d)."""
    q_HB = np.array([q_pc[0], q_pc[0], q_pc[0]])
    for j in (1, 2):
        q_HB[j] = quat.multiply(q_HB[j - 1], q_pc[j])
    bones = np.vstack([root[None], quat.rotate(q_HB, offsets)])
    arms = np.cumsum(bones[:0:-1], axis=0)[::-1]  # from each joint to the point
    return bones, np.hstack(list(-quat.skew(arms) @ quat.matrix(q_HB)))


def _variance(side: Side, chains: State, of_lengths: Array) -> Array:
    f = FINGERS.index(side.finger)
    return np.asarray(
        side.by_joints @ chains.P[f] @ side.by_joints.T
        + side.by_lengths @ of_lengths[f] @ side.by_lengths.T
    )


def _resized(geometry: HandGeometry, finger: str, change: Array) -> HandGeometry:
    """The hand with a finger's root elsewhere (3, m) and its bones longer by shares of themselves (3)."""
    joint = root_joint(finger)
    x, y, z = np.asarray(geometry.joint_positions[joint]) + change[:3]
    lengths = {s: geometry.lengths[s] * (1 + float(d)) for s, d in zip(CHAINS[finger], change[3:])}
    return replace(
        geometry,
        joint_positions={**geometry.joint_positions, joint: (float(x), float(y), float(z))},
        lengths={**geometry.lengths, **lengths},
    )


def _corrected(chains: State, f: int, H: Array, S: Array, weighed: Array) -> State:
    """Chain f after an innovation, S^-1 innovation `weighed` (m,), of derivative H (m, 43)."""
    q_pc, bias, q_SB, gain, P = (
        x.copy() for x in (chains.q_pc, chains.bias, chains.q_SB, chains.soft_tissue_gain, chains.P)
    )
    PH = P[f] @ H.T
    dx = PH @ weighed
    P[f] -= PH @ np.linalg.solve(S, PH.T)
    P[f] = 0.5 * (P[f] + P[f].T)
    q_pc[f] = _turned(q_pc[f], dx[: ERROR.bias])
    bias[f] += dx[ERROR.bias : ERROR.q_SB].reshape(4, 3)
    q_SB[f] = _turned(q_SB[f], dx[ERROR.q_SB : ERROR.soft_tissue])
    gain[f] += dx[ERROR.soft_tissue : ERROR.field_difference].reshape(3, 3)
    return replace(chains, q_pc=q_pc, bias=bias, q_SB=q_SB, soft_tissue_gain=gain, P=P)


def _turned(q: Array, d: Array) -> Array:
    return np.asarray(quat.normalize(quat.multiply(q, quat.exp(d.reshape(-1, 3)))))


@looped
def _fill_joints(q_pc: Array, q_SB: Array, soft_tissue_gain: Array, q: Array, A: Array) -> None:
    """True joints (3, 4) and their derivative (9, 43) by a chain's error states."""
    joint_jacobian_row(q_pc, q_SB, soft_tissue_gain, q, A)
