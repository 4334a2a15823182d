"""Joint angles from optical markers: a cluster on every segment, aligned with the hand in a still,
flat pose.

In      places of markers in a frame that stands still, m, NaN where hidden; `<segment>_1`,
        `<segment>_2`, ... three or more on a segment, `<finger>_tip` at a finger's end; a stretch
        in which the hand lies flat: fingers straight and parallel, joint angles known
Out     q_GS, joint angles with all three components, tips in the hand's frame from its cluster's
        centre
Source  Kortier, thesis 3.2.3 (axes from a static posture, dorsal is up) and 3.2.5 (Grood & Suntay
        1983; rigid-marker check by singular values); rigid fit: Soderkvist & Wedin 1993, J Biomech
        26:1473
Limits  axes rest on the flat pose alone, not on a flexion movement: a finger that is bent or spread
        there has that angle as its offset. Grood & Suntay's flexion, ab/adduction and rotation are
        our z-x'-y'': about the parent's z, the floating axis, the child's y
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGERS,
    JOINTS,
    SEGMENT,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

# a subject's name before a colon is passed over
NAME = re.compile(rf"(?:.*:)?(?P<segment>{'|'.join(SEGMENTS)})_\d+$", re.IGNORECASE)
TIP = re.compile(rf"(?:.*:)?(?P<finger>{'|'.join(FINGERS)})_tip$", re.IGNORECASE)
NAMING = "three or more markers a segment named like index_proximal_1, index_proximal_2, index_proximal_3; tips like index_tip"
# m, standard deviation of every marker's place in the flat pose; ours, above the noise of optical
# systems (0.1-0.5 mm)
STILL = 0.001
# of fingers assumed to lie flat; ours: clusters on a hand's back and on a finger differ in
# height by up to 20 deg
UPRIGHT = np.radians(45.0)
# m between the outermost fingers' clusters from which on their order is looked at
SIDE_BY_SIDE = 0.005
OTHERWISE = "another axis of the markers' frame points up (--up), the hand is the other one (--hand), or the stretch is another one (--static)"
# second to first singular value below which a cluster's markers lie on a line and tell no turn
# about it
FLATNESS = 0.05


@dataclass(frozen=True)
class Markers:
    """Places of markers over time."""

    t: Array  # (n,) s
    names: tuple[str, ...]
    places: Array  # (n, markers, 3) m, NaN where hidden


@dataclass(frozen=True)
class FlatPose:
    """When the hand lay flat and still, which way is up, and the thumb's known angles then."""

    start: float  # s
    stop: float
    up: Array  # (3,) unit, in the markers' frame: dorsal
    thumb_cmc: Array  # (3,) rad, z-x'-y''; zero = aligned with the fingers


@dataclass(frozen=True)
class Cluster:
    """The rigid fit of one segment's markers."""

    columns: tuple[int, ...]  # of Markers.places
    rest: Array  # (k, 3) m, mean places in the flat pose
    q: Array  # (n, 4) turn from the flat pose
    p: Array  # (n, 3) m, the centre of the cluster
    residuals: Array  # (n, k) m between a marker and where the rigid body has it


@dataclass(frozen=True)
class Rigidity:
    """How far a segment's markers moved against each other, and what that does to its axes."""

    segment: str
    movement_mean: float  # m
    movement_max: float
    # rad, between axes laid through the first three markers and those of the rigid body; NaN where
    # these are never seen together
    angle_mean: float
    angle_max: float


def trajectory_of(
    markers: Markers, fits: Mapping[str, Cluster], hand: Hand, pose: FlatPose
) -> Trajectory:
    """The hand's movement from its clusters; InputError where no joint can be determined."""
    joints = [k for k, joint in enumerate(JOINTS) if joint.parent in fits and joint.child in fits]
    tips = {
        m["finger"].lower(): k for k, name in enumerate(markers.names) if (m := TIP.match(name))
    }
    if not joints and len(tips) < 2:
        raise InputError(
            "processing.markers_without_joint", naming=NAMING, names=", ".join(markers.names[:8])
        )
    n = len(markers.t)
    q_GS, angles, places = (
        np.full((n, len(SEGMENTS), 4), np.nan),
        np.full((n, len(JOINTS), 3), np.nan),
        np.full((n, len(FINGERS), 3), np.nan),
    )
    if fits:
        q_GH = _hand_in_pose(fits, hand, pose.up)
        for segment, fit in fits.items():
            q_GS[:, SEGMENT[segment]] = quat.multiply(
                fit.q, quat.multiply(q_GH, _in_pose(segment, pose.thumb_cmc))
            )
        angles[:, joints] = joint_angles.of_segments(q_GS)[:, joints]
    for finger, k in tips.items():
        places[:, FINGERS.index(finger)] = _on_hand(
            markers.places[:, k], q_GS[:, SEGMENT["hand"]], fits.get("hand")
        )
    return Trajectory(hand, markers.t, angles, q_GS, places, np.zeros((n, len(SEGMENTS)), np.uint8))


def align(movement: Trajectory, pose: FlatPose) -> Trajectory:
    """The movement with every segment lying on the hand in the flat pose as it should: for
    orientations of bodies that sit anyhow; `pose.up` is not used."""
    still = movement.between(pose.start, pose.stop).q_GS
    q_GS, hand = movement.q_GS.copy(), _mean(still[:, SEGMENT["hand"]])
    if hand is None:
        raise InputError("processing.hand_orientation_unknown", start=pose.start, stop=pose.stop)
    for k, segment in enumerate(SEGMENTS):
        if (q_GB := _mean(still[:, k])) is not None:
            q_BS = quat.relative(q_GB, quat.multiply(hand, _in_pose(segment, pose.thumb_cmc)))
            q_GS[:, k] = quat.multiply(q_GS[:, k], q_BS)
    return replace(movement, q_GS=q_GS, angles=joint_angles.of_segments(q_GS))


def find_clusters(markers: Markers, pose: FlatPose) -> dict[str, Cluster]:
    """Rigid fits by segment, of those with three markers that do not lie on a line."""
    still = (markers.t >= pose.start) & (markers.t <= pose.stop)
    found: dict[str, list[int]] = {}
    for k, name in enumerate(markers.names):
        if m := NAME.match(name):
            found.setdefault(m["segment"].lower(), []).append(k)
    return {
        s: _cluster(s, markers, tuple(found[s]), still)
        for s in SEGMENTS
        if len(found.get(s, ())) >= 3
    }


def rigidity(fits: Mapping[str, Cluster], markers: Markers) -> list[Rigidity]:
    """Relative marker movement of every segment and its angle. Source: Kortier, thesis 3.2.5."""
    found = []
    for segment, fit in fits.items():
        if not np.isfinite(fit.residuals).any():
            continue
        seen = np.isfinite(fit.residuals[:, :3]).all(axis=1)
        angle = np.full(2, np.nan)
        if seen.any():
            actual = _axes(markers.places[seen][:, fit.columns[:3]])
            rigid = quat.matrix(fit.q[seen]) @ _axes(fit.rest[None, :3])
            between = np.arccos(np.clip((actual * rigid).sum(axis=1), -1.0, 1.0))
            angle = np.array([between.mean(), between.max()])
        found.append(
            Rigidity(
                segment,
                float(np.nanmean(fit.residuals)),
                float(np.nanmax(fit.residuals)),
                float(angle[0]),
                float(angle[1]),
            )
        )
    return found


def _cluster(segment: str, markers: Markers, columns: tuple[int, ...], still: Bools) -> Cluster:
    places = markers.places[:, columns]
    lying = places[still]
    if not np.isfinite(lying).all(axis=2).any(axis=0).all():
        raise InputError("processing.marker_hidden_in_pose", segment=segment)
    moved = np.nanstd(lying, axis=0).max()
    if moved > STILL:
        raise InputError(
            "processing.markers_move_in_pose",
            segment=segment,
            moved=1000.0 * moved,
            still=1000.0 * STILL,
        )
    rest = np.nanmean(lying, axis=0)
    spread = np.linalg.svd(rest - rest.mean(axis=0), compute_uv=False)
    if spread[1] < FLATNESS * spread[0]:
        raise InputError("processing.markers_on_a_line", segment=segment)
    q, p, residuals = _fit_rigid(rest, places)
    return Cluster(columns, rest, q, p, residuals)


def _fit_rigid(rest: Array, places: Array) -> tuple[Array, Array, Array]:
    """Turns (n, 4), centres (n, 3) and misfits (n, k); NaN where fewer than three markers are seen.
    One pass for each set of visible markers."""
    n, k = places.shape[:2]
    q, p, residuals = np.full((n, 4), np.nan), np.full((n, 3), np.nan), np.full((n, k), np.nan)
    seen: Bools = np.asarray(np.isfinite(places).all(axis=2))
    sets = seen @ (1 << np.arange(k))  # a number for each set of visible markers
    for visible in np.unique(sets):
        rows = sets == visible
        pattern = seen[np.argmax(rows)]
        if pattern.sum() < 3:
            continue
        here, there = rest[pattern], places[rows][:, pattern]
        centre_0, centre = here.mean(axis=0), there.mean(axis=1)
        if np.linalg.svd(here - centre_0, compute_uv=False)[1] < 1e-6:
            continue
        u, _, vt = np.linalg.svd(np.einsum("ki,nkj->nij", here - centre_0, there - centre[:, None]))
        mirror = np.linalg.det(u @ vt)
        vt[:, 2] *= mirror[:, None]
        R = np.swapaxes(u @ vt, 1, 2)
        q[rows] = _quaternion(R)
        p[rows] = centre + (R @ (rest.mean(axis=0) - centre_0))
        rigid = np.einsum("nij,kj->nki", R, here - centre_0) + centre[:, None]
        misfit = np.full((rows.sum(), k), np.nan)
        misfit[:, pattern] = np.linalg.norm(there - rigid, axis=-1)
        residuals[rows] = misfit
    return q, p, residuals


def _quaternion(R: Array) -> Array:
    """Of rotations (n, 3, 3) that are exact but for rounding: (n, 4), w not negative; a tenth of
    the time of an eigenvector. Source: Shepperd 1978, J Guid Control 1:223."""
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    # 4 w^2, 4 x^2, 4 y^2, 4 z^2
    squares = np.stack(
        [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], axis=-1
    )
    # 4 wx, 4 wy, 4 wz
    a, b, c = (
        R[:, 2, 1] - R[:, 1, 2],
        R[:, 0, 2] - R[:, 2, 0],
        R[:, 1, 0] - R[:, 0, 1],
    )
    # 4 xy, 4 xz, 4 yz
    d, e, f = (
        R[:, 0, 1] + R[:, 1, 0],
        R[:, 0, 2] + R[:, 2, 0],
        R[:, 1, 2] + R[:, 2, 1],
    )
    s0, s1, s2, s3 = squares.T
    rows = np.stack([s0, a, b, c, a, s1, d, e, b, d, s2, f, c, e, f, s3], axis=-1).reshape(-1, 4, 4)
    q = rows[np.arange(len(R)), squares.argmax(axis=1)]  # 4 q times its largest component
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(q * np.where(q[:, :1] < 0, -1.0, 1.0))


def _hand_in_pose(fits: Mapping[str, Cluster], hand: Hand, up: Array) -> Array:
    """The hand's orientation q_GH (4,) in the flat pose: dorsal is up, distal along the fingers."""
    along, roots = np.zeros(3), []
    for finger in FINGERS[1:]:
        centres = [fits[s].rest.mean(axis=0) for s in CHAINS[finger] if s in fits]
        roots += centres[:1]
        if "hand" in fits and centres and len(centres) < 2:
            centres = [fits["hand"].rest.mean(axis=0), *centres]
        if len(centres) >= 2:
            bone = centres[-1] - centres[0]
            along += bone / np.linalg.norm(bone)
    if np.linalg.norm(along) < 1e-9:
        raise InputError("processing.no_finger_direction", naming=NAMING)
    if (tilt := np.arcsin(abs(along @ up) / np.linalg.norm(along))) > UPRIGHT:
        raise InputError(
            "processing.fingers_not_level", tilt=float(np.degrees(tilt)), otherwise=OTHERWISE
        )
    distal = along - (along @ up) * up
    distal = distal / np.linalg.norm(distal)
    sign = side_sign(hand)
    x, y = sign * up, sign * distal
    z = np.cross(x, y)
    across = roots[-1] - roots[0]
    across = across - (across @ distal) * distal
    if np.linalg.norm(across) > SIDE_BY_SIDE and sign * z @ across <= abs(up @ across):
        raise InputError("processing.fingers_not_side_by_side", hand=hand, otherwise=OTHERWISE)
    return quat.from_matrix(np.stack([x, y, z], axis=-1))


def _in_pose(segment: str, thumb_cmc: Array) -> Array:
    """The segment on the hand (4,) in the flat pose: aligned, but for a thumb held otherwise."""
    return joint_angles.compose(thumb_cmc) if segment in CHAINS["thumb"] else quat.IDENTITY


def _on_hand(place: Array, q_GH: Array, hand: Cluster | None) -> Array:
    """A place (n, 3) in the hand's frame from its cluster's centre; as it is where the hand has no
    cluster."""
    return place if hand is None else quat.rotate(quat.conjugate(q_GH), place - hand.p)


def _mean(q: Array) -> Array | None:
    known = q[np.isfinite(q).all(axis=-1)]
    return quat.mean(known) if len(known) else None


def _axes(places: Array) -> Array:
    """Axes (n, 3, 3) in columns laid through three markers (n, 3, 3)."""
    x = places[:, 1] - places[:, 0]
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    z = np.cross(x, places[:, 2] - places[:, 0])
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)
