"""Contacts that are held for calibration tell `map` what no movement shows: how the hand's sensor and those of the last phalanges sit, where fingers hang on the hand, last phalanges' lengths.

In      the movement as it was found, its calibration and fingers; what was held together
Out     the fingers and the hand's geometry corrected, with smaller standard deviations, and what became of each contact
Source  data/contact_constraint.py, as `ekf` has it; linear Gaussian steps with the covariance of all that movement leaves open, correlations kept,
        under each likely answer to which contacts happened (contact_hypotheses.py); draws follow the covariance as an ensemble transform: Bishop et al. 2001
Limits  what movement shows (axes, other lengths, the joints' course) stays as it was found; outside the stretch of self-calibration tracking errs by option `tracked` more
"""

from collections.abc import Mapping, Sequence
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
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.methods.contact_hypotheses import (
    Answer,
    Hypothesis,
    decide,
    extend,
    first_hypothesis,
)
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.uncertainty import monte_carlo

EACH = 7  # errors of a finger: its last sensor about z, its root, its bones' shares
COUNT = 3 + EACH * len(FINGERS)  # those of the hand's sensor first
STEP = 1e-5  # rad, m, of differences
Z = np.array([0.0, 0.0, 1.0])


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
) -> Found:
    """The contacts one after the other, each linearised at the estimates after those before it; which of them happened is decided by all together."""
    before, reasons = _covariance(params, calibration, fingers), []
    hypotheses, looked_at = first_hypothesis(before), list[_Look]()
    for held in contacts:
        look = _look(params, movement, fingers, held)
        reasons.append(_reason(movement, look))
        if reasons[-1] is None:
            measure = partial(_measure, params, movement, calibration.geometry, looked_at, look)
            hypotheses = extend(hypotheses, measure)
            looked_at.append(look)
    best = decide(hypotheses)
    outcomes = iter([_outcome(look, answer) for look, answer in zip(looked_at, best.answers)])
    geometry = _resize(calibration.geometry, best.errors)
    changes = _draw_changes(params, before, best.P)
    return Found(
        [_correct_finger(f, best.errors, changes, geometry) for f in fingers],
        geometry,
        tuple(reason or next(outcomes) for reason in reasons),
    )


def _look(
    params: Params, movement: Trajectory, fingers: Sequence[Finger], held: HeldContact
) -> _Look:
    known = {f.name for f in fingers if CHAINS.get(f.name, ("",))[-1] in f.segments.q_BS}
    times = (held.onset + share * (held.end - held.onset) for share in (EARLY, LATE))
    early, late = (min(int(movement.t.searchsorted(t)), len(movement) - 1) for t in times)
    start, stop = max(f.t[0] for f in fingers), min(f.t[-1] for f in fingers)
    inside = start <= held.onset and held.end <= stop
    places = [p for p in places_of(held) if p[0] == PALM or p[0] in known]
    return _Look(held, places, (early, late), 0.0 if inside else np.radians(params.tracked))


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


def _of(finger: str) -> slice:
    start = 3 + EACH * FINGERS.index(finger)
    return slice(start, start + EACH)


def _covariance(params: Params, calibration: Calibration, fingers: Sequence[Finger]) -> Array:
    """Of what movement leaves open (COUNT, COUNT)."""
    variance = np.zeros((COUNT, COUNT))
    variance[:3, :3] = np.radians(params.mounting) ** 2 * np.eye(3)
    of_lengths = length_covariance.covariance(calibration.geometry, params.length_guess)
    for finger in fingers:
        if finger.name not in CHAINS:
            continue
        own, chain = variance[_of(finger.name), _of(finger.name)], CHAINS[finger.name]
        own[0, 0] = np.radians(params.mounting) ** 2
        own[1:7, 1:7] = of_lengths[FINGERS.index(finger.name)]
        for k, segment in enumerate(chain):
            if segment in calibration.lengths_sd:
                share = calibration.lengths_sd[segment] / calibration.geometry.lengths[segment]
                own[4 + k, 1:7] = own[1:7, 4 + k] = 0.0
                own[4 + k, 4 + k] = share**2
    return variance


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
    where = _of(point if name == PALM else name)
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
    own, f = errors[_of(finger)], FINGERS.index(finger)
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


def _draw_changes(params: Params, before: Array, after: Array) -> Array:
    """By how much the draws' errors (DRAWS, COUNT) of what movement leaves open change, as the covariance does; where fingers hang was not drawn."""
    numbers, sd = np.zeros((monte_carlo.DRAWS, COUNT)), np.zeros(COUNT)
    mountings, lengths = monte_carlo.mounting_numbers(), monte_carlo.length_numbers()
    numbers[:, :3], sd[:3] = mountings[:, SEGMENT["hand"]], np.radians(params.mounting)
    for finger, chain in CHAINS.items():
        turn, length = _of(finger).start, _of(finger).stop - 1
        numbers[:, turn] = mountings[:, SEGMENT[chain[-1]], 2]
        numbers[:, length] = lengths
        sd[turn], sd[length] = np.radians(params.mounting), params.length_guess
    drawn = np.flatnonzero((sd > 0) & (np.diag(before) > 0))
    scale = np.sqrt(np.diag(before)[drawn])
    left, axes = np.linalg.eigh(after[np.ix_(drawn, drawn)] / np.outer(scale, scale))
    root = (axes * np.sqrt(np.maximum(left, 0.0))) @ axes.T
    changes = np.zeros(numbers.shape)
    changes[:, drawn] = sd[drawn] * (numbers[:, drawn] @ root - numbers[:, drawn])
    return changes


def _correct_finger(
    finger: Finger, errors: Array, changes: Array, geometry: HandGeometry
) -> Finger:
    """A finger, or the forearm, whose sensors sit as the contacts tell, with the draws as far off as contacts leave them."""
    columns = [0, 1, 2, *(range(COUNT)[_of(finger.name)] if finger.name in CHAINS else ())]
    change = changes[:, columns]
    turns, turned = _turns(finger, errors[columns]), _turns(finger, change)
    found = finger.segments
    q_BS = {
        s: quat.multiply(quat.exp(turns[s]), q) if s in turns else q for s, q in found.q_BS.items()
    }
    q_GB = {
        s: quat.multiply(q, quat.exp(-turns[s])) if s in turns else q for s, q in found.q_GB.items()
    }
    p_BS = {
        s: quat.rotate(quat.exp(turns[s]), p) if s in turns else p for s, p in found.p_BS.items()
    }
    sure = finger.sure
    by_angles, by_tip = _output_slopes(q_GB, finger, geometry)
    return replace(
        finger,
        segments=replace(found, q_BS=q_BS, q_GB=q_GB, p_BS=p_BS),
        sure=replace(
            sure,
            q_BS_errors={s: e + turned.get(s, 0.0) for s, e in sure.q_BS_errors.items()},
            angle_errors=sure.angle_errors + np.einsum("majk,dk->dmaj", by_angles, change),
            tip_errors=sure.tip_errors + np.einsum("mak,dk->dma", by_tip, change),
        ),
    )


def _turns(finger: Finger, errors: Array) -> dict[str, Array]:
    """By how much sensors sit turned (..., 3) rad, of the hand's and the finger's errors (..., n)."""
    turns = {"hand": errors[..., :3]}
    if finger.name in CHAINS:
        turns[CHAINS[finger.name][-1]] = errors[..., 3:4] * Z
    return turns


def _output_slopes(
    q_GB: Mapping[str, Array], finger: Finger, geometry: HandGeometry
) -> tuple[Array, Array]:
    """Derivatives of angles (m, joints, 3, n) and of the tip (m, 3, n) by the hand's and the finger's errors; the forearm has no tip."""
    rows, chain = finger.sure.rows, CHAINS.get(finger.name, ())

    def outputs(e: Array) -> tuple[Array, Array]:
        q_GS = np.full((len(rows), len(SEGMENTS), 4), np.nan)
        for name, q in q_GB.items():
            q_GS[:, SEGMENT[name]] = q[rows]
        q_GS[:, SEGMENT["hand"]] = quat.multiply(q_GS[:, SEGMENT["hand"]], quat.exp(-e[:3]))
        if not chain:
            return joint_angles.of_segments(q_GS), np.full((len(rows), 3), np.nan)
        last = SEGMENT[chain[-1]]
        q_GS[:, last] = quat.multiply(q_GS[:, last], quat.exp(-e[3] * Z))
        angles = np.where(IS_DOF, joint_angles.of_segments(q_GS), 0.0)
        every = np.zeros(COUNT)
        every[_of(finger.name)] = e[3:]
        tips = forward_kinematics.tips(joint_angles.compose(angles), _resize(geometry, every))
        return angles, tips[:, FINGERS.index(finger.name)]

    count = 3 + (EACH if chain else 0)
    at = outputs(np.zeros(count))
    moved = [outputs(e) for e in STEP * np.eye(count)]
    by_angles, by_tip = (np.stack([(m[k] - at[k]) / STEP for m in moved], axis=-1) for k in (0, 1))
    by_tip[..., 4:7] = 0.0  # roots are counted where tips are put on the wrist
    return np.nan_to_num(by_angles), np.nan_to_num(by_tip)


def _resize(geometry: HandGeometry, errors: Array) -> HandGeometry:
    """The hand with roots and bones as the contacts tell."""
    places, lengths = dict(geometry.joint_positions), dict(geometry.lengths)
    for finger in FINGERS:
        own, joint = errors[_of(finger)], root_joint(finger)
        x, y, z = np.asarray(places[joint]) + own[1:4]
        places[joint] = (float(x), float(y), float(z))
        for segment, share in zip(CHAINS[finger], own[4:7]):
            lengths[segment] *= 1 + float(share)
    return replace(geometry, joint_positions=places, lengths=lengths)
