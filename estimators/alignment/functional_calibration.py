"""How each sensor sits on its segment, however it was put on: from gravity on the flat hand and
from the axes about which the joints bend.

In      the pieces of the calibration (functional_movements.py), a Calibration from the initial pose
Out     a Calibration with q_BS of every sensor of which the pieces tell something; the others as in
        the pose, against the hand
Source  Kortier, thesis (2.34): x from gravity on the flat hand, z from the gyroscope in flexion, R
        = [x, z x x, z] re-orthogonalised; steps: 3.2.2. All steps together then make the joints
        move as they can (mounting_fit.py, ours)
Limits  where flexion is zero only the still postures tell: a finger that was not straight there is
        off by that. The sensors of hand, thumb metacarpal and forearm do not bend: which way they
        point on the level hand is seen only while all move together (`figure_eight`)
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.alignment import initial_pose, mounting_fit
from handscope.estimators.alignment.functional_movements import (
    STEPS,
    CalibrationMovement,
    FunctionalParams,
)
from handscope.estimators.alignment.mounting_fit import GravitySighting
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, side_sign
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import make_upright

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])
CONTRADICTION = 15.0 * DEG  # ours
AXIS_SD = 5.0 * DEG  # sd of a flexion axis; ours: what misaligned sensors leave without calibration
AXES_FROM = ("flexion_thumb_ip", "flexion_mcp", "flexion_all")  # the later the better
ALONGSIDE: Mapping[
    str, tuple[str, ...]
] = {  # whose flexion axis a segment shares while all move together, in the order of looking
    **{
        s: (*CHAINS[f][k + 1 : k + 2], *CHAINS[f][max(k - 1, 0) : k])
        for f in FINGERS
        for k, s in reversed(list(enumerate(CHAINS[f])))
    },
    "hand": tuple(CHAINS[f][0] for f in FINGERS[1:]),
    "forearm": ("hand",),
}


def combine(
    params: FunctionalParams,
    pieces: Mapping[str, CalibrationMovement],
    pose: Calibration,
    mounting: Mapping[str, Array],
) -> Calibration:
    """The pose's calibration (alignment full or common) with the sensors as the accepted pieces
    say; `mounting`: nominal.

    Pieces with problems are left out. A sensor for which no piece gives an axis keeps what the pose
    says; without any axis the pose's calibration stays.
    """
    good = {step: p for step, p in pieces.items() if not p.problems}
    seen = _initial_mountings(good, pose)
    if not seen:
        return pose
    nominal = {
        s: _wahba([_vertical_pair(good, pose, s), (_axis_of(pose.q_BS[s]), Z)])
        for s in pose.q_GS
        if s not in seen
    }
    movements = [p.movement for p in good.values() if p.movement is not None]
    sights = _gravity_sightings(params, good, pose, [*seen, *nominal])
    fitted = mounting_fit.fit(
        {**seen, **nominal}, movements, sights, pose.hand, params.soft_tissue * DEG
    )
    far = [
        s
        for s, q in seen.items()
        if quat.angle(quat.relative(q, fitted.q_BS[s])) > CONTRADICTION
        or _axis_disagreement(good, s) > CONTRADICTION
    ]
    if far:  # no careless step does that: another movement was done, or a sensor has slipped
        unsure = {s: np.full(3, CONTRADICTION) for s in fitted.sd}
        fitted = mounting_fit.Fit(
            {**fitted.q_BS, **seen}, unsure, CONTRADICTION**2 * np.eye(3 * len(unsure))
        )
    determined = [
        s for s in pose.q_GS if s in seen or s == "hand" or (not far and fitted.sd[s][0] < AXIS_SD)
    ]
    q_BS, sd = ({s: values[s] for s in determined} for values in (fitted.q_BS, fitted.sd))
    quality = {
        s: replace(q, misalignment=_mounting_deviation(mounting, s, q_BS.get(s), q.misalignment))
        for s, q in pose.quality.items()
    }
    warnings = _warnings(pose, sd, [s for s in STEPS if s not in good], far)
    steps = {step: p.quality for step, p in good.items()}
    known = replace(
        apply_mounting(pose, q_BS),
        is_functional=True,
        quality=quality,
        warnings=(*pose.warnings, *warnings),
        steps=steps,
    )
    return replace(known, q_BS_sd=sd, q_BS_covariance=fitted.of(determined))


def _initial_mountings(
    good: Mapping[str, CalibrationMovement], pose: Calibration
) -> dict[str, Array]:
    """q_BS (4,) of (2.34) for every segment with a flexion axis of its own or of a neighbour that
    moved along with it."""
    axes = {s: b.axis for step in AXES_FROM if step in good for s, b in good[step].bent.items()}
    eight = good["figure_eight"].together if "figure_eight" in good else {}
    for segment, others in ALONGSIDE.items():
        near = [o for o in others if o in axes and o in eight]
        if segment not in axes and segment in eight and near:
            on_hand = sum((quat.rotate(eight[o].q_ab, axes[o]) for o in near), np.zeros(3))
            axes[segment] = quat.rotate(
                quat.conjugate(eight[segment].q_ab), on_hand / np.linalg.norm(on_hand)
            )
    return {
        s: _wahba([_vertical_pair(good, pose, s), (z, Z)])
        for s, z in axes.items()
        if s in pose.q_GS
    }


def _axis_disagreement(good: Mapping[str, CalibrationMovement], segment: str) -> float:
    """Largest angle between the segment's axes in different steps."""
    axes = [p.bent[segment].axis for p in good.values() if segment in p.bent]
    return max(
        (float(np.arccos(np.clip(a @ b, -1.0, 1.0))) for a in axes for b in axes), default=0.0
    )


def _vertical_pair(
    good: Mapping[str, CalibrationMovement], pose: Calibration, segment: str
) -> tuple[Array, Array]:
    """Up in the sensor's frame and in the segment's: x in a flat posture; without one as the
    initial pose has it."""
    flat = "thumb_flat" if segment.startswith("thumb") else "flat_hand"
    if flat in good and segment in good[flat].up:
        return good[flat].up[segment], np.array([side_sign(pose.hand), 0.0, 0.0])
    up = _up(pose, segment)
    return up, quat.rotate(pose.q_BS[segment], up)


def _wahba(pairs: Sequence[tuple[Array, Array]]) -> Array:
    """The rotation (4,) that takes the first of each pair to the second."""
    U, _, Vt = np.linalg.svd(sum((np.outer(b, a) for a, b in pairs), np.zeros((3, 3))))
    return quat.from_matrix(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _gravity_sightings(
    params: FunctionalParams,
    good: Mapping[str, CalibrationMovement],
    pose: Calibration,
    segments: Sequence[str],
) -> list[GravitySighting]:
    """Gravity in the flat postures, level, and in the initial pose, against the hand."""
    sd, found = params.posture_sd * DEG, []
    q_GH = _segment(pose, "hand")
    for segment in segments:
        finger = segment.split("_")[0]
        thumb, chain = finger == "thumb", CHAINS.get(finger, ())
        # by their children: what is to be straight from the hand to here
        joints = chain[: chain.index(segment) + 1] if chain else ()
        roll = sd * np.sqrt(len(joints)) if thumb else 1.0 * DEG
        flat = good.get("thumb_flat" if thumb else "flat_hand")
        if flat is not None and segment in flat.up:
            # each lies by itself
            from_table = (
                ("thumb", *joints[1:])
                if thumb
                else ("forearm",)
                if segment == "forearm"
                else ("hand", *joints)
            )
            found.append(
                GravitySighting(
                    segment,
                    flat.up[segment],
                    tuple(f"{flat.step}: {j}" for j in from_table),
                    sd,
                    roll,
                )
            )
        if segment not in ("hand", "forearm"):
            held, q_HB = (
                tuple(f"pose: {j}" for j in joints),
                quat.relative(q_GH, _segment(pose, segment)),
            )
            found.append(
                GravitySighting(
                    segment, _up(pose, segment), held, sd, roll, _up(pose, "hand"), q_HB
                )
            )
    return found


def apply_mounting(pose: Calibration, q_BS: Mapping[str, Array]) -> Calibration:
    """The pose re-evaluated with this mounting: the hand from gravity, every segment on it as the pose requires."""
    q_GH_full = _segment(pose, "hand")
    ahead = quat.normalize(
        make_upright(
            initial_pose.palm_down(pose.hand), quat.rotate(q_BS["hand"], _up(pose, "hand"))
        )
    )
    q_GS, mounting, north = {}, dict(pose.q_BS), dict(pose.north)
    for segment in pose.q_GS:
        q_GB = quat.multiply(ahead, quat.relative(q_GH_full, _segment(pose, segment)))
        q_GS[segment] = make_upright(
            quat.multiply(q_GB, q_BS.get(segment, pose.q_BS[segment])), _up(pose, segment)
        )
        mounting[segment] = q_BS.get(segment, quat.relative(q_GB, q_GS[segment]))
        if segment in north:
            north[segment] -= float(
                quat.twist(quat.multiply(q_GS[segment], quat.conjugate(pose.q_GS[segment])), 2)
            )
    return replace(pose, q_GS=q_GS, q_BS=mounting, north=north)


def _segment(pose: Calibration, segment: str) -> Array:
    """Where the pose took the segment to be (4,)."""
    return quat.multiply(pose.q_GS[segment], quat.conjugate(pose.q_BS[segment]))


def _up(pose: Calibration, segment: str) -> Array:
    return quat.rotate(quat.conjugate(pose.q_GS[segment]), Z)


def _axis_of(q_BS: Array) -> Array:
    """The segment's z axis in the sensor's frame."""
    return quat.rotate(quat.conjugate(q_BS), Z)


def _mounting_deviation(
    mounting: Mapping[str, Array], segment: str, q_BS: Array | None, otherwise: float
) -> float:
    """Between the nominal mounting and this one."""
    return (
        otherwise
        if q_BS is None
        else float(quat.angle(quat.relative(mounting.get(segment, quat.IDENTITY), q_BS)))
    )


def _warnings(
    pose: Calibration, sd: Mapping[str, Array], missing: Sequence[str], far: Sequence[str]
) -> tuple[str, ...]:
    """Sensors without a complete calibration, and what is missing."""
    others = [s for s in pose.q_GS if s not in sd]
    sensors, steps = ", ".join(others), ", ".join(STEPS[s] for s in missing)
    warnings = []
    if others and missing:
        warnings.append(phrase("functional.pose_alone_steps", sensors=sensors, steps=steps))
    elif others:
        warnings.append(phrase("functional.pose_alone", sensors=sensors))
    elif missing:
        warnings.append(phrase("functional.steps_missing", steps=steps))
    if far:
        warnings.append(phrase("functional.contradiction", sensors=", ".join(far)))
    elif sd["hand"][0] > AXIS_SD:
        warnings.append(phrase("functional.hand_from_nominal"))
    return tuple(warnings)
