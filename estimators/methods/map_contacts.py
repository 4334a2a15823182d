"""Contacts that are held for calibration tell `map` what no movement shows: how the hand's sensor and those of the last phalanges sit, where fingers hang on the hand, last phalanges' lengths.

In      the movement as it was found, its calibration and fingers; the initial pose, what was held together
Out     the fingers and the hand's geometry corrected, with smaller standard deviations, and what became of each contact
Source  data/contact_constraint.py, as `ekf` has it; linear Gaussian steps with the covariance of all that movement leaves open (map_unobserved.py), correlations kept,
        under each likely answer to which contacts happened (contact_hypotheses.py)
Limits  what movement shows (axes, other lengths, the joints' course) stays as it was found; outside the stretch of self-calibration tracking errs by option `tracked` more
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.contact_constraint import (
    EARLY,
    LATE,
    STILL,
    Constraint,
    between_two,
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
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods.contact_hypotheses import (
    Answer,
    Hypothesis,
    decide,
    extend,
    first_hypothesis,
)
from handscope.estimators.methods.map_options import Params
from handscope.estimators.methods.map_pose import PoseSeen, condition
from handscope.estimators.methods.map_unobserved import (
    COUNT,
    STEP,
    Z,
    columns_of,
    correct_finger,
    covariance,
    draw_changes,
    drift,
    resize,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger


@dataclass(frozen=True)
class _Look:
    """A contact, and what of the movement it is looked at with."""

    held: HeldContact
    places: Sequence[Place]  # that are known
    rows: tuple[int, int]  # when the hand had come to rest, when it is used
    drift: float  # rad, of tracking


@dataclass(frozen=True)
class Found:
    """What contacts tell."""

    fingers: list[Finger]
    geometry: HandGeometry
    outcomes: tuple[ContactOutcome, ...]


def apply(
    params: Params,
    movement: Trajectory,
    calibration: Calibration,
    fingers: Sequence[Finger],
    contacts: Sequence[HeldContact],
    pose: PoseSeen | None = None,
) -> Found:
    """What the pose tells, then the contacts one after the other, each linearised at the estimates after those before it; which of them happened is decided by all together."""
    before, reasons = covariance(params, calibration, fingers), []
    known = (np.zeros(COUNT), before)
    if pose is not None:
        known = condition(params, fingers, pose, before)
    hypotheses, looked_at = first_hypothesis(*known), list[_Look]()
    for held in contacts:
        look = _look(params, movement, fingers, held)
        reasons.append(_reason(movement, look))
        if reasons[-1] is None:
            measure = partial(_measure, params, movement, calibration.geometry, looked_at, look)
            hypotheses = extend(hypotheses, measure)
            looked_at.append(look)
    best = decide(hypotheses)
    outcomes = iter([_outcome(look, answer) for look, answer in zip(looked_at, best.answers)])
    geometry = resize(calibration.geometry, best.errors)
    changes = draw_changes(params, before, best.P)
    return Found(
        [correct_finger(f, best.errors, changes, geometry) for f in fingers],
        geometry,
        tuple(reason or next(outcomes) for reason in reasons),
    )


def _look(
    params: Params, movement: Trajectory, fingers: Sequence[Finger], held: HeldContact
) -> _Look:
    known = {f.name for f in fingers if CHAINS.get(f.name, ("",))[-1] in f.segments.q_BS}
    times = (held.onset + share * (held.end - held.onset) for share in (EARLY, LATE))
    early, late = (min(int(movement.t.searchsorted(t)), len(movement) - 1) for t in times)
    places = [p for p in places_of(held) if p[0] == PALM or p[0] in known]
    return _Look(held, places, (early, late), drift(params, fingers, held.onset, held.end))


def _measure(
    params: Params,
    movement: Trajectory,
    geometry: HandGeometry,
    before: Sequence[_Look],
    look: _Look,
    hypothesis: Hypothesis,
) -> tuple[Constraint, Array]:
    """A contact around what is found under a hypothesis, which tells how often the same was used before."""
    times = sum(
        answer.happened and other.held.contacts == look.held.contacts
        for other, answer in zip(before, hypothesis.answers)
    )
    return _measurement(params, movement, geometry, look, hypothesis.errors, times)


def _outcome(look: _Look, answer: Answer) -> ContactOutcome:
    if not answer.happened:
        return ContactOutcome(look.held, "missed", answer.missed)
    left_out = tuple(look.places[k][0] for k in answer.away)
    return ContactOutcome(look.held, "used", answer.missed, left_out)


def _reason(movement: Trajectory, look: _Look) -> ContactOutcome | None:
    """Why a contact is not used; None where nothing speaks against it."""
    held, places = look.held, look.places
    segments = [SEGMENT["hand"]]
    segments += [SEGMENT[s] for name, _ in places if name in CHAINS for s in CHAINS[name]]
    early, late = movement.q_GS[list(look.rows)][:, segments]
    is_there = movement.t[0] <= held.onset and held.end <= movement.t[-1]
    enough = len(places) >= (LEAST_ON_TABLE if held.on_table else 2)
    if not (is_there and enough and np.isfinite(early).all() and np.isfinite(late).all()):
        return ContactOutcome(held, "not measured")
    on_hand = [quat.relative(q[:1], q[1:]) for q in (early, late)]
    turned = np.linalg.norm(quat.log(quat.relative(*on_hand)), axis=-1)
    return ContactOutcome(held, "moving") if turned.max() > STILL else None


def _measurement(
    params: Params,
    movement: Trajectory,
    geometry: HandGeometry,
    look: _Look,
    errors: Array,
    times: int,
) -> tuple[Constraint, Array]:
    """A contact around the errors found so far, and its derivative by all of them."""
    q_GS, held, places = movement.q_GS[look.rows[1]], look.held, look.places

    def touch(e: Array) -> tuple[Array, Array]:
        up = _vertical(q_GS, e)
        return np.array([_place(q_GS, geometry, held, p, up, e) for p in places]), up

    def constrain(e: Array) -> Constraint:
        where, up = touch(e)
        if held.on_table:
            return on_a_plane(params, where, np.tile(up, (len(where), 1)), times)
        return between_two(params, where, held, times)

    found = constrain(errors)
    columns = [*range(3), *(k for name, at in places for k in _columns(name, at))]
    H = np.zeros((len(found.residual), COUNT))
    for k in dict.fromkeys(columns):
        moved = errors.copy()
        moved[k] += STEP
        H[:, k] = (constrain(moved).residual - found.residual) / STEP
    where, _ = touch(errors)
    roots = np.array([geometry.roots()[FINGERS.index(at if n == PALM else n)] for n, at in places])
    arms = look.drift**2 * ((where - roots) ** 2).sum(axis=1)
    drifting = np.einsum("kma,k,kna->mn", found.by_places, arms, found.by_places)
    return replace(found, noise=found.noise + drifting), H


def _columns(name: str, point: str) -> range:
    where = columns_of(point if name == PALM else name)
    return range(where.start, where.stop)


def _vertical(q_GS: Array, errors: Array) -> Array:
    up = quat.rotate(quat.conjugate(q_GS[SEGMENT["hand"]]), Z)
    return np.asarray(quat.rotate(quat.exp(errors[:3]), up))


def _place(
    q_GS: Array, geometry: HandGeometry, held: HeldContact, place: Place, up: Array, errors: Array
) -> Array:
    """A place (3,) in the hand's frame."""
    name, point = place
    finger = point if name == PALM else name
    own, f = errors[columns_of(finger)], FINGERS.index(finger)
    root = geometry.roots()[f] + own[1:4]
    if name == PALM:
        return np.asarray(root + palm_mark(geometry))
    q_HB = quat.relative(q_GS[SEGMENT["hand"]], q_GS[[SEGMENT[s] for s in CHAINS[finger]]])
    q_HB = quat.multiply(quat.exp(errors[:3]), q_HB)
    q_HB[2] = quat.multiply(q_HB[2], quat.exp(-own[0] * Z))
    bones = geometry.chain_offsets()[f] * (1 + own[4:7, None])
    if held.contacts[0].b in ELSEWHERE:
        towards = pulp_direction(held, up, geometry.hand)
        towards_D = quat.rotate(quat.conjugate(q_HB[2]), towards)
        bones[2] += pulp_offset(geometry, finger, towards_D, FINGERTIPS[finger])[0]
    else:
        bones[2] += offset(geometry, finger, point, FINGERTIPS[finger])
    return np.asarray(root + quat.rotate(q_HB, bones).sum(axis=0))
