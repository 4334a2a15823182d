"""Contacts that are held for calibration tell `map` what no movement shows: how the hand's sensor and those of the last phalanges sit, where fingers hang on the hand, last phalanges' lengths.

In      the movement as it was found, its calibration and fingers; what was held together
Out     the fingers and the hand's geometry corrected, with smaller standard deviations, and what became of each contact
Source  data/contact_constraint.py, as `ekf` has it; a linear Gaussian step with the covariance of all that movement leaves open, correlations kept
Limits  what movement shows (axes, other lengths, the joints' course) stays as it was found; outside the stretch of self-calibration tracking errs by option `tracked` more
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.contact_constraint import (
    EARLY,
    LATE,
    REFUSED,
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
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import chi2_sf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger

EACH = 7  # errors of a finger: its last sensor about z, its root, its bones' shares
COUNT = 3 + EACH * len(FINGERS)  # those of the hand's sensor first
STEP = 1e-5  # rad, m, of differences
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class _When:
    """What of the movement a contact is looked at with."""

    row: int
    drift: float  # rad, of tracking
    times: int  # that the same was used before


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
    """The contacts one after the other, each linearised at the estimate after those before it."""
    before = _covariance(params, calibration, fingers)
    errors, P = np.zeros(COUNT), before
    outcomes: list[ContactOutcome] = []
    stretch = max(f.t[0] for f in fingers), min(f.t[-1] for f in fingers)
    known = {f.name for f in fingers if CHAINS.get(f.name, ("",))[-1] in f.segments.q_BS}
    for held in contacts:
        places = [p for p in places_of(held) if p[0] == PALM or p[0] in known]
        rows = [_row(movement, held, share) for share in (EARLY, LATE)]
        outcome = _reason(movement, held, places, rows)
        if outcome is None:
            inside = stretch[0] <= held.onset and held.end <= stretch[1]
            times = [o.held.contacts for o in outcomes if o.used].count(held.contacts)
            when = _When(rows[1], 0.0 if inside else np.radians(params.tracked), times)
            constraint, H = _measurement(
                params, movement, calibration.geometry, held, places, errors, when
            )
            S = constraint.noise + H @ P @ H.T
            gain = np.linalg.solve(S, H @ P).T
            r = -constraint.residual
            likely = chi2_sf(float(r @ np.linalg.solve(S, r)), len(r)) > REFUSED
            outcome = ContactOutcome(held, "used" if likely else "missed", constraint.missed)
            if likely:
                errors, P = errors + gain @ r, P - gain @ H @ P
        outcomes.append(outcome)
    corrected = [_correct_finger(f, errors, before - P, calibration.geometry) for f in fingers]
    return Found(corrected, _resize(calibration.geometry, errors), tuple(outcomes))


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


def _row(movement: Trajectory, held: HeldContact, share: float) -> int:
    t = held.onset + share * (held.end - held.onset)
    return min(int(movement.t.searchsorted(t)), len(movement) - 1)


def _reason(
    movement: Trajectory, held: HeldContact, places: Sequence[Place], rows: Sequence[int]
) -> ContactOutcome | None:
    """Why a contact is not used; None where nothing speaks against it."""
    segments = [SEGMENT["hand"]]
    segments += [SEGMENT[s] for name, _ in places if name in CHAINS for s in CHAINS[name]]
    early, late = movement.q_GS[rows][:, segments]
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
    held: HeldContact,
    places: Sequence[Place],
    errors: Array,
    when: _When,
) -> tuple[Constraint, Array]:
    """A contact around the errors found so far, and its derivative by all of them."""
    q_GS = movement.q_GS[when.row]

    def touch(e: Array) -> tuple[Array, Array]:
        up = _vertical(q_GS, e)
        return np.array([_place(q_GS, geometry, held, p, up, e) for p in places]), up

    def constrain(e: Array) -> Constraint:
        where, up = touch(e)
        if held.on_table:
            return on_a_plane(params, where, np.tile(up, (len(where), 1)), when.times)
        return between_two(params, where, held, when.times)

    found = constrain(errors)
    columns = [*range(3), *(k for name, at in places for k in _columns(name, at))]
    H = np.zeros((len(found.residual), COUNT))
    for k in dict.fromkeys(columns):
        moved = errors.copy()
        moved[k] += STEP
        H[:, k] = (constrain(moved).residual - found.residual) / STEP
    where, _ = touch(errors)
    roots = np.array([geometry.roots()[FINGERS.index(at if n == PALM else n)] for n, at in places])
    arms = when.drift**2 * ((where - roots) ** 2).sum(axis=1)
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


def _correct_finger(finger: Finger, errors: Array, gained: Array, geometry: HandGeometry) -> Finger:
    """A finger whose sensors sit as the contacts tell, with what its standard deviations lose by it."""
    own = errors[_of(finger.name)] if finger.name in CHAINS else np.zeros(EACH)
    last = CHAINS[finger.name][-1] if finger.name in CHAINS else ""
    turns = {"hand": errors[:3], last: own[0] * Z}
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
    segments = replace(found, q_BS=q_BS, q_GB=q_GB, p_BS=p_BS)
    if finger.name not in CHAINS:
        return replace(finger, segments=segments)
    columns = [0, 1, 2, *range(_of(finger.name).start, _of(finger.name).stop)]
    less = gained[np.ix_(columns, columns)]
    by_angles, by_tip = _output_slopes(q_GB, finger, geometry)
    sure = finger.sure
    return replace(
        finger,
        segments=segments,
        sure=replace(
            sure,
            q_BS=_reduced_mountings(sure.q_BS, last, less),
            angles=_reduce_sd(sure.angles, by_angles, less),
            tip=_reduce_sd(sure.tip, by_tip, less),
        ),
    )


def _reduced_mountings(sd: Mapping[str, Array], last: str, less: Array) -> dict[str, Array]:
    variances = {"hand": np.diag(less)[:3], last: np.array([0.0, 0.0, less[3, 3]])}
    return {
        s: np.sqrt(np.maximum(v**2 - variances.get(s, 0.0), (0.1 * v) ** 2)) for s, v in sd.items()
    }


def _reduce_sd(sd: Array, slopes: Array, less: Array) -> Array:
    """Standard deviations less a variance; a tenth of them is left at least."""
    variance = np.einsum("...k,kl,...l->...", slopes, less, slopes)
    return np.asarray(np.sqrt(np.maximum(sd**2 - variance, (0.1 * sd) ** 2)))


def _output_slopes(
    q_GB: Mapping[str, Array], finger: Finger, geometry: HandGeometry
) -> tuple[Array, Array]:
    """Derivatives of angles (m, joints, 3, 10) and of the tip (m, 3, 10) by the hand's and the finger's errors."""
    rows, last = finger.sure.rows, CHAINS[finger.name][-1]

    def outputs(e: Array) -> tuple[Array, Array]:
        q_GS = np.full((len(rows), len(SEGMENTS), 4), np.nan)
        for name, q in q_GB.items():
            q_GS[:, SEGMENT[name]] = q[rows]
        q_GS[:, SEGMENT["hand"]] = quat.multiply(q_GS[:, SEGMENT["hand"]], quat.exp(-e[:3]))
        q_GS[:, SEGMENT[last]] = quat.multiply(q_GS[:, SEGMENT[last]], quat.exp(-e[3] * Z))
        angles = np.where(IS_DOF, joint_angles.of_segments(q_GS), 0.0)
        every = np.zeros(COUNT)
        every[_of(finger.name)] = e[3:]
        hand = _resize(geometry, every)
        tips = forward_kinematics.tips(joint_angles.compose(angles), hand)
        return angles, tips[:, FINGERS.index(finger.name)]

    at = outputs(np.zeros(3 + EACH))
    moved = [outputs(e) for e in STEP * np.eye(3 + EACH)]
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
