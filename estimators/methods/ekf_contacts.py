"""Places that touch - fingertips, a mark on the palm, a table: a measurement of the joints and mountings of all chains that take part.

In      a hand's chains, its geometry with the covariance of its lengths, where a mark on its palm lies; what is held together
Out     all of them corrected, or the same where the contact is refused: farther off than errors explain, or the hand moved
Source  contact_constraint.py. The covariances between two chains, and with the lengths, that the update makes are not kept,
        as between chains everywhere here; whether it happened: contact_hypotheses.py, decided by each contact alone and how many before it were missed
Limits  used once a contact, as places on the skin stay while it is held
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.contact_constraint import (
    EARLY,
    LATE,
    STILL,
    Constraint,
    ContactParams,
    between_two,
    kind_sd,
    on_a_plane,
    places_of,
    pulp_direction,
)
from handscope.estimators.data.fingertip_contacts import (
    FINGERTIPS,
    offset,
    palm_mark,
    pulp_offset,
)
from handscope.estimators.data.held_contact import (
    ELSEWHERE,
    LEAST_ON_TABLE,
    PALM,
    ContactOutcome,
    HeldContact,
    Place,
)
from handscope.estimators.finger_ekf.filter import State
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE, joint_jacobian_row
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.methods.contact_hypotheses import weigh
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.typing import Array

OF_HAND = slice(ERROR.q_SB, ERROR.q_SB + 3)  # the hand's mounting in a chain's errors


@dataclass(frozen=True)
class Pending:
    """A contact that is still to be used."""

    held: HeldContact
    times: int = 0  # that the same was used before
    looked_at: int = 0  # contacts before it
    missed: int = 0  # of them
    q_before: Array | None = (
        None  # (F, 3, 4) the chains' joints when it had come to rest; None: not yet
    )

    @property
    def due(self) -> float:
        """When it is to be looked at next, s."""
        share = EARLY if self.q_before is None else LATE
        return self.held.onset + share * (self.held.end - self.held.onset)


@dataclass(frozen=True)
class HandState:
    """What contacts correct."""

    chains: State
    geometry: HandGeometry
    of_lengths: Array  # (5, 6, 6) covariance of the lengths: hand/length_covariance.py


@dataclass(frozen=True)
class _Touch:
    """A place that touches, in the hand's frame, with its derivatives."""

    finger: int  # whose chain and lengths it depends on; of a mark its finger's lengths
    place: Array  # (3,) m
    by_joints: Array  # (3, 43) by the errors of the chain
    by_lengths: Array  # (3, 6) by those of its lengths
    vertical: Array  # (3,) as the chain has it


def pending_contacts(params: ContactParams, held: Sequence[HeldContact]) -> tuple[Pending, ...]:
    """The contacts whose kinds are asked for."""
    return tuple(Pending(h) for h in held if kind_sd(params, h) > 0)


def apply(
    params: ContactParams, hand: HandState, pending: Pending
) -> tuple[HandState, ContactOutcome]:
    """What is known after a contact, and what became of it."""
    held = pending.held
    places = [p for p in places_of(held) if p[0] == PALM or _is_known(hand, p)]
    if len(places) < (LEAST_ON_TABLE if held.on_table else 2):
        return hand, ContactOutcome(held, "not measured")
    if _is_moving(hand.chains, pending, places):
        return hand, ContactOutcome(held, "moving")
    touches = [_touch(hand, place, held) for place in places]
    innovation = _innovation(params, hand, pending, touches)
    assumed = weigh(innovation.constraint, innovation.S, pending.missed, pending.looked_at)
    answer = max(assumed, key=lambda a: a.log_probability).answer
    if not answer.happened:
        return hand, ContactOutcome(held, "missed", answer.missed)
    if not answer.away:
        return _corrected(hand, innovation), ContactOutcome(held, "used", answer.missed)
    left_out = tuple(FINGERS[touches[k].finger] for k in answer.away)
    others = [t for k, t in enumerate(touches) if k not in answer.away]
    without = _innovation(params, hand, pending, others)
    outcome = ContactOutcome(held, "used", without.constraint.missed, left_out)
    return _corrected(hand, without), outcome


def _is_known(hand: HandState, place: Place) -> bool:
    return bool(hand.chains.known[FINGERS.index(place[0])].all())


def _is_moving(chains: State, pending: Pending, places: Sequence[Place]) -> bool:
    """Whether a finger's joint turned while it was to be held."""
    if pending.q_before is None:
        return False
    fingers = [FINGERS.index(name) for name, _ in places if name in FINGERS]
    turned = quat.log(quat.relative(pending.q_before[fingers], chains.q_pc[fingers]))
    return bool(np.linalg.norm(turned, axis=-1).max() > STILL)


@dataclass(frozen=True)
class _Innovation:
    """A contact as a measurement."""

    touches: Sequence[_Touch]
    constraint: Constraint
    by_joints: dict[int, Array]  # (m, 43) by finger
    by_lengths: dict[int, Array]  # (m, 6)
    S: Array  # (m, m) its covariance

    @property
    def weighed(self) -> Array:
        return np.asarray(np.linalg.solve(self.S, -self.constraint.residual))


def _innovation(
    params: ContactParams, hand: HandState, pending: Pending, touches: Sequence[_Touch]
) -> _Innovation:
    where, held, times = np.array([t.place for t in touches]), pending.held, pending.times
    constraint = (
        on_a_plane(params, where, np.array([t.vertical for t in touches]), times)
        if held.on_table
        else between_two(params, where, held, times)
    )
    by_joints: dict[int, Array] = {}
    by_lengths: dict[int, Array] = {}
    for touch, by_place, by_vertical in zip(touches, constraint.by_places, constraint.by_vertical):
        H = by_place @ touch.by_joints
        H[:, OF_HAND] += by_vertical @ quat.skew(touch.vertical)  # q_SB exp(d) turns it by -d
        f = touch.finger
        by_joints[f] = by_joints.get(f, 0.0) + H
        by_lengths[f] = by_lengths.get(f, 0.0) + by_place @ touch.by_lengths
    S = constraint.noise
    for f in by_joints:
        S = S + by_joints[f] @ hand.chains.P[f] @ by_joints[f].T
        S = S + by_lengths[f] @ hand.of_lengths[f] @ by_lengths[f].T
    return _Innovation(touches, constraint, by_joints, by_lengths, S)


def _touch(hand: HandState, place: Place, held: HeldContact) -> _Touch:
    chains, geometry, (name, point) = hand.chains, hand.geometry, place
    nothing = np.zeros((3, SIZE))
    if name == PALM:
        f = FINGERS.index(point)
        mark = geometry.roots()[f] + palm_mark(geometry)
        by_lengths = np.hstack([np.eye(3), np.zeros((3, 3))])
        return _Touch(f, mark, nothing, by_lengths, np.zeros(3))
    f = FINGERS.index(name)
    q, A = np.empty((3, 4)), np.zeros((9, SIZE))
    _fill_joints(
        *(np.array(x[f]) for x in (chains.q_pc, chains.q_SB, chains.soft_tissue_gain)), q, A
    )
    vertical = quat.rotate(quat.conjugate(chains.q_SB[f, 0]), chains.up[f, 0])
    offsets, rolling = geometry.chain_offsets()[f].copy(), np.zeros((3, 9))
    if held.contacts[0].b in ELSEWHERE:  # the pulp touches with what is nearest
        towards = pulp_direction(held, vertical, geometry.hand)
        pulp, rolling = _pulp(q, geometry, name, towards)
        offsets[-1] += pulp
    else:
        offsets[-1] += offset(geometry, name, point, FINGERTIPS[name])
    bones, J = _point(q, geometry.roots()[f], offsets)
    by_lengths = np.hstack([np.eye(3), bones[1:].T])
    return _Touch(f, bones.sum(axis=0), (J + rolling) @ A, by_lengths, vertical)


def _pulp(q_pc: Array, geometry: HandGeometry, finger: str, towards: Array) -> tuple[Array, Array]:
    """The pulp's farthest point (3,) in a direction of the hand's frame, in that of the distal phalanx, and how it rolls on (3, 9) in the hand's frame with errors of the joints."""
    q_HM = quat.multiply(q_pc[0], q_pc[1])
    q_HD = quat.multiply(q_HM, q_pc[2])
    towards_D = quat.rotate(quat.conjugate(q_HD), towards)
    point, by_direction = pulp_offset(geometry, finger, towards_D, FINGERTIPS[finger])
    q_BD = (quat.multiply(q_pc[1], q_pc[2]), q_pc[2], quat.IDENTITY)
    turns = np.hstack([quat.matrix(quat.conjugate(q)) for q in q_BD])  # of the distal phalanx
    return point, quat.matrix(q_HD) @ by_direction @ quat.skew(towards_D) @ turns


def _point(q_pc: Array, root: Array, offsets: Array) -> tuple[Array, Array]:
    """A chain's bones (4, 3) in the hand's frame, from wrist to point, and the derivative (3, 9) of the point by errors d of its joints, q exp(d)."""
    q_HB = np.array([q_pc[0], q_pc[0], q_pc[0]])
    for j in (1, 2):
        q_HB[j] = quat.multiply(q_HB[j - 1], q_pc[j])
    bones = np.vstack([root[None], quat.rotate(q_HB, offsets)])
    arms = np.cumsum(bones[:0:-1], axis=0)[::-1]  # from each joint to the point
    return bones, np.hstack(list(-quat.skew(arms) @ quat.matrix(q_HB)))


def _corrected(hand: HandState, found: _Innovation) -> HandState:
    S, weighed, chains, geometry = found.S, found.weighed, hand.chains, hand.geometry
    of_lengths = hand.of_lengths.copy()
    for f, H in found.by_joints.items():
        lengths_H = of_lengths[f] @ found.by_lengths[f].T
        geometry = _resized(geometry, FINGERS[f], lengths_H @ weighed)
        of_lengths[f] -= lengths_H @ np.linalg.solve(S, lengths_H.T)
        chains = _corrected_chain(chains, f, H, S, weighed)
    return HandState(chains, geometry, of_lengths)


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


def _corrected_chain(chains: State, f: int, H: Array, S: Array, weighed: Array) -> State:
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
