"""What no movement tells `map`: how the sensors of hand and forearm sit, the last phalanges' about their hinges, where fingers hang on the hand and their bones' shares; and the fingers with these corrected.

In      fingers and calibration as self-calibration found them; errors found from an initial pose and contacts, with their covariance
Out     the covariance of these errors before anything is known of them; the fingers with their sensors turned, draws as far off as the covariance says
Source  draws follow the covariance as an ensemble transform: Bishop et al. 2001
Limits  first order in the errors
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.uncertainty import monte_carlo

EACH = 7  # errors of a finger: its last sensor about z, its root, its bones' shares
COUNT = 3 + EACH * len(FINGERS) + 3  # the hand's sensor first, the forearm's last
STEP = 1e-5  # rad, m, of differences
Z = np.array([0.0, 0.0, 1.0])


def columns_of(finger: str) -> slice:
    """Where the errors of a finger, or of the forearm, stand among all."""
    if finger == "forearm":
        return slice(COUNT - 3, COUNT)
    start = 3 + EACH * FINGERS.index(finger)
    return slice(start, start + EACH)


def covariance(params: Params, calibration: Calibration, fingers: Sequence[Finger]) -> Array:
    """Of what movement leaves open (COUNT, COUNT)."""
    variance = np.zeros((COUNT, COUNT))
    for whole in (slice(3), columns_of("forearm")):
        variance[whole, whole] = np.radians(params.mounting) ** 2 * np.eye(3)
    of_lengths = length_covariance.covariance(
        calibration.geometry, params.length_guess, calibration.lengths_sd
    )
    for finger in fingers:
        if finger.name not in CHAINS:
            continue
        own = variance[columns_of(finger.name), columns_of(finger.name)]
        own[0, 0] = np.radians(params.mounting) ** 2
        own[1:7, 1:7] = of_lengths[FINGERS.index(finger.name)]
    return variance


def drift(params: Params, fingers: Sequence[Finger], start: float, stop: float) -> float:
    """How far tracking has drifted between two instants (s), rad: not at all within the stretch of self-calibration."""
    inside = max(f.t[0] for f in fingers) <= start and stop <= min(f.t[-1] for f in fingers)
    return 0.0 if inside else float(np.radians(params.tracked))


def draw_changes(params: Params, before: Array, after: Array) -> Array:
    """By how much the draws' errors (DRAWS, COUNT) of what movement leaves open change, as the covariance does; where fingers hang was not drawn."""
    numbers, sd = np.zeros((monte_carlo.DRAWS, COUNT)), np.zeros(COUNT)
    mountings, lengths = monte_carlo.mounting_numbers(), monte_carlo.length_numbers()
    for name, whole in (("hand", slice(3)), ("forearm", columns_of("forearm"))):
        numbers[:, whole], sd[whole] = mountings[:, SEGMENT[name]], np.radians(params.mounting)
    for finger, chain in CHAINS.items():
        turn, length = columns_of(finger).start, columns_of(finger).stop - 1
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


def correct_finger(finger: Finger, errors: Array, changes: Array, geometry: HandGeometry) -> Finger:
    """A finger, or the forearm, whose sensors sit as pose and contacts tell, with the draws as far off as these leave them."""
    columns = [0, 1, 2, *range(COUNT)[columns_of(finger.name)]]
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
    """By how much sensors sit turned (..., 3) rad, of the hand's errors and the finger's, or the forearm's (..., n)."""
    hand, own = errors[..., :3], errors[..., 3:]
    if finger.name in CHAINS:
        return {"hand": hand, CHAINS[finger.name][-1]: own[..., :1] * Z}
    return {"hand": hand, finger.name: own}


def _output_slopes(
    q_GB: Mapping[str, Array], finger: Finger, geometry: HandGeometry
) -> tuple[Array, Array]:
    """Derivatives of angles (m, joints, 3, n) and of the tip (m, 3, n) by the hand's errors and its own; the forearm has no tip."""
    rows, chain = finger.sure.rows, CHAINS.get(finger.name, ())

    def outputs(e: Array) -> tuple[Array, Array]:
        q_GS = np.full((len(rows), len(SEGMENTS), 4), np.nan)
        for name, q in q_GB.items():
            q_GS[:, SEGMENT[name]] = q[rows]
        for name, turn in _turns(finger, e).items():
            q_GS[:, SEGMENT[name]] = quat.multiply(q_GS[:, SEGMENT[name]], quat.exp(-turn))
        if not chain:
            return joint_angles.of_segments(q_GS), np.full((len(rows), 3), np.nan)
        angles = np.where(IS_DOF, joint_angles.of_segments(q_GS), 0.0)
        every = np.zeros(COUNT)
        every[columns_of(finger.name)] = e[3:]
        tips = forward_kinematics.tips(joint_angles.compose(angles), resize(geometry, every))
        return angles, tips[:, FINGERS.index(finger.name)]

    own = columns_of(finger.name)
    count = 3 + own.stop - own.start
    at = outputs(np.zeros(count))
    moved = [outputs(e) for e in STEP * np.eye(count)]
    by_angles, by_tip = (np.stack([(m[k] - at[k]) / STEP for m in moved], axis=-1) for k in (0, 1))
    if chain:
        by_tip[..., 4:7] = 0.0  # roots are counted where tips are put on the wrist
    return np.nan_to_num(by_angles), np.nan_to_num(by_tip)


def resize(geometry: HandGeometry, errors: Array) -> HandGeometry:
    """The hand with roots and bones as they were found."""
    places, lengths = dict(geometry.joint_positions), dict(geometry.lengths)
    for finger in FINGERS:
        own, joint = errors[columns_of(finger)], root_joint(finger)
        x, y, z = np.asarray(places[joint]) + own[1:4]
        places[joint] = (float(x), float(y), float(z))
        for segment, share in zip(CHAINS[finger], own[4:7]):
            lengths[segment] *= 1 + float(share)
    return replace(geometry, joint_positions=places, lengths=lengths)
