"""A real hand's motion from optical markers: joint angles by fitting the model hand's marker places to the measured ones.

In      places of markers in a global frame with z up: three on the hand's back, one on the elbow, two on each finger
Out     coordinates (n, 54) of the simulated hand, how far its markers stay from the measured ones
Source  marker set of Fabisch et al. 2022 (hand_embodiment, DFKI); Gauss-Newton finger by finger, all instants at once; the markers' places on the
        hand and the hand's size by an outer least-squares fit
Limits  two points a finger leave DIP and thumb IP to a coupling (0.6 of PIP; as thumb MCP) and the thumb's pronation fixed: a likely motion, not a
        measurement of that person; the forearm's own rotation is taken from the hand
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import FINGERS, JOINTS, LIMITS, Hand, side_sign
from handscope.estimators.hand.forward_kinematics import CHAIN_SEGMENTS
from handscope.estimators.hand.geometry import MEAN_HAND_LENGTH, HandGeometry, HandMeasures, sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.kinematics import base_orientation
from handscope.estimators.simulation.motion import COORDINATES, SIZE, interpolate_postures
from handscope.estimators.simulation.movements.grasp_postures import freedoms
from handscope.estimators.simulation.movements.guided_movements import RATE, frame_motion
from handscope.estimators.simulation.movements.task_performance import (
    POSE_THUMB,
    Performance,
    relaxed,
)
from handscope.estimators.simulation.movements.whole_hand import smooth

DORSAL = (0.010, 0.008)  # m, of a marker above the proximal and the distal bone; ours
# markers sit on the proximal and the distal phalanx of each chain
CARRIED, ROWS = np.array([[1, 2], *[[0, 2]] * 4]), np.arange(5)[:, None]
DIP_PER_PIP = 0.6
TOLERANCE = 0.005  # m, what a marker may be off by: soft tissue and glove; ours
PULL = 0.01  # m of misfit that a radian away from the relaxed posture costs: keeps what the markers do not tell natural
SMOOTHED = 100.0  # Hz
CUTOFF = 6.0  # Hz: voluntary movement stays below (Winter 2009, ch. 3)
FREE = [[COORDINATES[c] for c in ("thumb_cmc_flexion", "thumb_cmc_deviation", "thumb_mcp_flexion")]]
FREE += [
    [COORDINATES[f"{f}_{c}"] for c in ("mcp_flexion", "mcp_deviation", "pip_flexion")]
    for f in FINGERS[1:]
]
NATURAL_OF = {COORDINATES[name]: (low, high) for f in FINGERS for name, low, high in freedoms(f)}
COUPLED = [COORDINATES[c] for c in ("thumb_ip_flexion", *(f"{f}_dip_flexion" for f in FINGERS[1:]))]


@dataclass(frozen=True)
class Markers:
    """Measured places, m; NaN where hidden."""

    t: Array  # (n,) s
    back: Array  # (n, 3, 3) three on the back of the hand, in any order
    elbow: Array  # (n, 3)
    fingers: Array  # (n, 5, 2, 3) thumb first: on the proximal phalanx, on the distal one

    def at(self, rows: Array) -> "Markers":
        return Markers(self.t[rows], self.back[rows], self.elbow[rows], self.fingers[rows])


@dataclass(frozen=True)
class CapturedMotion:
    """The model hand that follows the markers."""

    geometry: HandGeometry
    t: Array  # (n,) s
    x: Array  # (n, 54) coordinates, not smoothed; NaN for a finger with a hidden marker
    misfit: Array  # (n, 5, 2) m between the model's markers and the measured ones; NaN where hidden


@dataclass(frozen=True)
class _MarkerPlacement:
    """Where markers sit, from the 9 numbers of the outer fit: cluster on the hand (turn, shift), hand length, places along two bones."""

    geometry: HandGeometry
    q_HC: Array  # (4,) from the cluster's frame to the hand's
    p_HC: Array  # (3,) m, the cluster's centre from the wrist's
    along: Array  # (2,) share of the bone's length from its proximal end


def fit_markers(markers: Markers, hand: Hand, frames: int = 24) -> CapturedMotion:
    """Fit markers' places and the hand's size on `frames` instants, then the joint angles at all."""
    seen = np.flatnonzero(
        np.isfinite(markers.back).all(axis=(1, 2))
        & np.isfinite(markers.fingers).all(axis=(1, 2, 3))
    )
    few = markers.at(seen[np.linspace(0, len(seen) - 1, frames).astype(int)])
    start, scale = (
        _first_guess(few, hand),
        np.array([0.5, 0.5, 0.5, 0.02, 0.02, 0.02, 0.01, 0.2, 0.2]),
    )

    def misfit(change: Array) -> Array:
        placed = _apply_change(start, change * scale, hand)
        x = _angles(_on_hand(few, placed), placed, 6)
        return np.concatenate(
            [
                _marker_residuals(x, few, placed).ravel() / TOLERANCE,
                PULL * (x[:, FREE] - _usual()[FREE]).ravel() / TOLERANCE,
                change,
            ]
        )

    found = least_squares(misfit, np.zeros(9), xtol=1e-4, ftol=1e-4, max_nfev=30).x
    placed = _apply_change(start, found * scale, hand)
    x = _angles(_on_hand(markers, placed), placed, 15)
    misfits = np.linalg.norm(_marker_residuals(x, markers, placed), axis=-1)
    for finger, own in enumerate(np.column_stack([FREE, COUPLED])):
        x[np.ix_(np.isnan(misfits[:, finger]).any(axis=1), own)] = np.nan
    return CapturedMotion(placed.geometry, markers.t, _with_arm(x, markers, placed), misfits)


def performance(captured: CapturedMotion, name: str, begin: float, end: float) -> Performance:
    """What was captured between two instants, smoothed, hidden stretches bridged, begun and ended gently: a task like any other."""
    t = np.arange(captured.t[0], captured.t[-1], 1 / SMOOTHED)
    known = np.isfinite(captured.x)
    x = np.stack(
        [np.interp(t, captured.t[k], column[k]) for k, column in zip(known.T, captured.x.T)],
        axis=-1,
    )
    x = sosfiltfilt(butter(2, CUTOFF, fs=SMOOTHED, output="sos"), x, axis=0)
    x[:, :3] -= x[np.searchsorted(t, begin), :3]
    x[:, 6:] = np.clip(x[:, 6:], LIMITS[..., 0].ravel(), LIMITS[..., 1].ravel())
    n = round((end - begin + 1.0) * RATE)
    own = np.linspace(0.0, end - begin + 1.0, n + 1)
    played = begin + _gentle(own, 1.0)
    return frame_motion(
        name,
        interpolate_postures(
            own, np.stack([np.interp(played, t, column) for column in x.T], axis=-1)
        ),
        lead=2.5,
    )


def _gentle(t: Array, ramp: float) -> Array:
    """Time played at time t: rates rise from 0 to 1 within `ramp` and fall again."""
    rate = smooth(np.minimum(t, t[-1] - t) / ramp)
    played = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))])
    return np.asarray(played * (t[-1] - ramp) / played[-1])


def _first_guess(few: Markers, hand: Hand) -> _MarkerPlacement:
    """The cluster flat on the middle of the palm's back, fingers on average straight ahead of it."""
    q_GC, centre = _cluster(few)
    ahead = quat.rotate(quat.conjugate(q_GC), few.fingers[:, 1:, 0].mean(axis=1) - centre).mean(
        axis=0
    )
    across = quat.rotate(quat.conjugate(q_GC), few.fingers[:, 4, 0] - few.fingers[:, 1, 0]).mean(
        axis=0
    )  # from index to little
    distal = ahead / np.linalg.norm(ahead)
    ulnar = across - (across @ distal) * distal
    ulnar /= np.linalg.norm(ulnar)
    sign = side_sign(hand)
    # x dorsal, y distal, z ulnar are right-handed on the left hand; all three turned on the right
    dorsal = sign * np.cross(distal, ulnar)
    R_CH = sign * np.column_stack([dorsal, distal, ulnar])
    geometry = sized(hand, HandMeasures(hand_length=MEAN_HAND_LENGTH))
    middle = sign * np.array([0.02, 0.6 * geometry.palm_length, 0.0])
    return _MarkerPlacement(
        geometry, quat.conjugate(quat.from_matrix(R_CH)), middle, np.array([0.8, 0.8])
    )


def _apply_change(start: _MarkerPlacement, change: Array, hand: Hand) -> _MarkerPlacement:
    geometry = sized(
        hand, HandMeasures(hand_length=float(np.clip(MEAN_HAND_LENGTH + change[6], 0.15, 0.23)))
    )
    q_HC = quat.multiply(quat.exp(change[:3]), start.q_HC)
    return replace(
        start,
        geometry=geometry,
        q_HC=q_HC,
        p_HC=start.p_HC + change[3:6],
        along=np.clip(start.along + change[7:], 0.0, 1.0),
    )


def _cluster(markers: Markers) -> tuple[Array, Array]:
    """Frame q_GC (n, 4) and centre (n, 3) of the three markers on the hand's back."""
    a, b, c = (markers.back[:, k] for k in range(3))
    x = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    z = np.cross(x, c - a)
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    return np.array(
        [quat.from_matrix(R) for R in np.stack([x, np.cross(z, x), z], axis=-1)]
    ), markers.back.mean(axis=1)


def _on_hand(markers: Markers, placed: _MarkerPlacement) -> Array:
    """The fingers' markers (n, 5, 2, 3) in the hand's frame from the wrist's centre."""
    q_GC, centre = _cluster(markers)
    in_cluster = quat.rotate(
        quat.conjugate(q_GC)[:, None, None], markers.fingers - centre[:, None, None]
    )
    return np.asarray(quat.rotate(placed.q_HC, in_cluster) + placed.p_HC)


def _model(x: Array, placed: _MarkerPlacement) -> Array:
    """The model's markers (n, 5, 2, 3) in the hand's frame; the wrist is neutral."""
    q_pc = joint_angles.compose(x[:, 6:].reshape(len(x), len(JOINTS), 3))
    ends = forward_kinematics.joint_places(q_pc, placed.geometry)
    starts = np.concatenate(
        [
            np.broadcast_to(placed.geometry.roots()[None, :, None], ends[:, :, :1].shape),
            ends[:, :, :2],
        ],
        axis=2,
    )
    starts, ends = starts[:, ROWS, CARRIED], ends[:, ROWS, CARRIED]
    q_HB = forward_kinematics.segments_on(np.tile(quat.IDENTITY, (len(x), 1)), q_pc)[
        :, CHAIN_SEGMENTS[ROWS, CARRIED]
    ]
    above = side_sign(placed.geometry.hand) * np.array([[d, 0.0, 0.0] for d in DORSAL])
    return np.asarray(starts + placed.along[:, None] * (ends - starts) + quat.rotate(q_HB, above))


def _angles(measured: Array, placed: _MarkerPlacement, rounds: int) -> Array:
    """Coordinates (n, 54) of the fingers: damped Gauss-Newton of three freedoms a finger, hidden markers without weight."""
    usual = _usual()
    x = np.tile(usual, (len(measured), 1))
    free = np.array(FREE)
    low, high = np.moveaxis(np.radians([[NATURAL_OF[k] for k in finger] for finger in FREE]), -1, 0)

    def misses(x: Array) -> Array:
        difference = np.nan_to_num(_model(x, placed) - measured).reshape(len(x), 5, 6)
        return np.concatenate([difference, PULL * (x[:, free] - usual[free])], axis=-1)

    for _ in range(rounds):
        miss = misses(x)
        J = np.stack(
            [(misses(_change_coordinates(x, free[:, k], 1e-6)) - miss) / 1e-6 for k in range(3)],
            axis=-1,
        )
        step = np.linalg.solve(
            np.swapaxes(J, -1, -2) @ J, np.swapaxes(J, -1, -2) @ miss[..., None]
        )[..., 0]
        x = _change_coordinates(
            x, free, np.clip(x[:, free] - np.clip(step, -0.3, 0.3), low, high) - x[:, free]
        )
    return x


def _usual() -> Array:
    """The posture that markers pull away from: relaxed, with the thumb turned as in the flat pose."""
    usual = relaxed()
    usual[COORDINATES["thumb_cmc_pronation"]] = np.radians(POSE_THUMB[2])
    return usual


def _change_coordinates(x: Array, columns: Array, by: Array | float) -> Array:
    """Changed coordinates; the last joints follow."""
    x = x.copy()
    x[:, columns] += by
    x[:, COUPLED] = x[:, np.array(FREE)[:, 2]] * np.array([1.0, *(DIP_PER_PIP,) * 4])
    return x


def _marker_residuals(x: Array, markers: Markers, placed: _MarkerPlacement) -> Array:
    return np.asarray(_model(x, placed) - _on_hand(markers, placed))


def _with_arm(x: Array, markers: Markers, placed: _MarkerPlacement) -> Array:
    """Wrist and forearm from the hand's pose and the elbow; headings counted from the forearm's mean one."""
    q_GC, centre = _cluster(markers)
    q_GH = quat.multiply(q_GC, quat.conjugate(placed.q_HC))
    wrist = centre - quat.rotate(q_GH, placed.p_HC)
    sign = side_sign(placed.geometry.hand)
    along = (
        sign
        * (wrist - markers.elbow)
        / np.linalg.norm(wrist - markers.elbow, axis=-1, keepdims=True)
    )  # the forearm's y axis
    vx, vy, vz = np.moveaxis(quat.rotate(quat.conjugate(q_GH), along), -1, 0)
    bent = np.stack([np.arcsin(np.clip(vx, -1, 1)), np.arctan2(-vz, vy), np.zeros(len(x))], axis=-1)
    mean = np.nanmean(sign * along, axis=0)
    # turns the mean forearm to the global y axis
    north = quat.about(2, np.arctan2(mean[0], mean[1]))
    q_GF = quat.multiply(north, quat.multiply(q_GH, quat.conjugate(joint_angles.compose(bent))))
    base = quat.from_matrix(base_orientation(placed.geometry.hand))
    out = x.copy()
    out[:, :3] = quat.rotate(north, wrist - np.nanmean(wrist, axis=0))
    out[:, 3:6] = np.unwrap(
        joint_angles.decompose(quat.multiply(quat.conjugate(base), q_GF)), axis=0
    )
    out[:, COORDINATES["wrist_flexion"] : COORDINATES["wrist_flexion"] + 3] = bent
    assert out.shape[1] == SIZE
    return out
