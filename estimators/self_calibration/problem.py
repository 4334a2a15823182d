"""Knowns and unknowns of self-calibration: sensors on a chain of joints, their readings, the unknowns and how they move on their manifold.

In      even samples of inertial sensors whose segments hang together by joints
Out     Problem (readings and priors), Unknowns (a point on the manifold), their increments
Source  Kortier, thesis ch. 4, (4.1)-(4.5). Written without loss in fewer unknowns: rates and accelerations (4.8), (4.9) are the readings less biases and
        errors, places and velocities (4.17a, b) follow from them, and the segments' poses (4.10) from the sensors': orientations of the sensors are all
        of the trajectory that is left. A sensor's pose on its segment and the segment's length follow from where its joints and their axes lie in
        the sensor's frame, in which the problem is linear (segments.py gives p_BS, q_BS and lengths)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.hand.anatomy import CHAINS, JOINTS, Hand, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration.soft_tissue import tissue_response

THESIS = "Kortier, thesis 4.5.1"
# what hangs on the hand with a joint of its own, segments from there on
LIMBS = {**CHAINS, "forearm": ("forearm",)}
Z = np.array([0.0, 0.0, 1.0])  # flexion axis in the frame of a segment
TILTING = 1e-5  # rad, between axes whose difference is a derivative
# deg/s, m/s^2: standard deviation over a second in which a sensor rests, 3 times an MPU-9250's
RESTING_GYR, RESTING_ACC = 0.3, 0.06


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of the errors: of one sample of each relation, of each unknown."""

    gyr: float = option(1e-3, "rad/s", "noise of a gyroscope's sample", THESIS, least=1e-6)
    acc: float = option(
        0.08,
        "m/s^2",
        "noise of an accelerometer's sample, play of joints and skin included",
        THESIS,
        least=1e-5,
    )
    hinge: float = option(
        1.0,
        "deg",
        "how far the axis of a hinge lies apart in its two segments",
        "Kortier, thesis 4.5.1: 1e-3 rad, a printed hinge; ours for fingers",
    )
    still: float = option(
        10.0, "m/s^2", "size of the hand's acceleration, zero on average", f"{THESIS}, (4.15)"
    )
    gyr_bias: float = option(
        2.0,
        "deg/s",
        "bias of a gyroscope",
        "MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, table 1, after one calibration; size ours",
    )
    gyr_bias_walk: float = option(
        0.001,
        "deg/s/sqrt(s)",
        "random walk of a gyroscope's bias, which is looked for as one number",
        "ours: consumer MEMS, 10 deg/h",
    )
    rest: float = option(
        0.05,
        "deg/s",
        "turning that nobody sees in a second in which every sensor rests",
        "ours: a hand on a table; noise of 100 samples is 0.01",
    )
    acc_bias: float = option(
        0.2,
        "m/s^2",
        "bias of an accelerometer",
        "MPU-9250 product specification: 60 mg before calibration; size ours",
    )
    scale: float = option(
        0.005,
        "1",
        "scale and cross-axis errors of a sensor: each entry of its matrix",
        "left after a strip's calibration, Salchow-Hoemmen 2019, 2.1; size ours. Sensors never calibrated: 0.03",
        least=1e-6,
    )
    mounting: float = option(
        5.0,
        "deg",
        "how far a sensor may sit off its nominal mounting; where a movement tells it to be off by more it counts for less",
        "Salchow-Hoemmen 2019, 5: 5 to 10 deg; size ours",
        least=1e-3,
    )
    length: float = option(
        10.0,
        "mm",
        "how far the given lengths of segments may be off: as the hand of an average person's; 1 to 2 where they were measured",
        "hand length of adults: SD 10 mm of 187, ANSUR (Gordon et al. 1989), and ratios; size ours",
        least=1e-3,
    )
    place: float = option(
        0.1,
        "m",
        "distance of a joint's centre from a sensor",
        "Kortier, thesis 4.3.1: 1; a hand's size",
    )
    bone: float = option(
        0.5,
        "mm",
        "joints of a bone along the hinge's axis: the axis is square to the bone",
        "Kortier, thesis 4.2 by definition of its frames; size ours",
    )
    aside: float = option(
        2.0,
        "mm",
        "distance of a sensor from the middle of its segment, along the axes of its hinges",
        "Kortier, thesis 4.5.2: x = 0; size ours",
    )
    skin_turn: float = option(
        3.0,
        "deg",
        "turn of a sensor on its segment for 90 deg in the joint before it",
        "skin moves with the joint; size ours",
        least=1e-6,
    )
    skin_slide: float = option(
        1.5,
        "mm",
        "slide of a sensor on its segment for 90 deg in the joint before it",
        "skin moves with the joint; size ours",
        least=1e-6,
    )
    skin_law: float = option(
        0.5,
        "1",
        "how much farther than in proportion skin follows a joint that is bent by 90 deg, share of it; less far where it levels off",
        "skin moves with the joint; size ours",
        least=1e-6,
    )
    delay: float = option(
        5.0,
        "ms",
        "time between what gyroscope and accelerometer of a sensor see",
        "half a sample of 100 Hz: rates are means over a sample or instants; ours",
    )


@dataclass(frozen=True)
class Chain:
    """Sensors joined to a tree: the first is the root, every other one hangs on one joint."""

    sensors: tuple[str, ...]  # by segment
    joints: tuple[str, ...]  # of anatomy.JOINTS, (J,)
    parents: Indices  # (J,) rows of sensors
    children: Indices  # (J,)
    hinges: Indices  # (H,) which joints turn about one axis

    @property
    def incidence(self) -> Array:
        """What each sensor's error does to each joint (J, S): +1 the child's, -1 the parent's."""
        a = np.zeros((len(self.joints), len(self.sensors)))
        rows = np.arange(len(self.joints))
        a[rows, self.children], a[rows, self.parents] = 1.0, -1.0
        return a


@dataclass(frozen=True)
class Readings:
    """Even samples of the chain's sensors, in their frames."""

    dt: float  # s
    gyr: Array  # (n, S, 3) rad/s
    acc: Array  # (n, S, 3) m/s^2
    gyr_doubt: Array  # (n, S) factor on the noise's standard deviation: 1 usually, large where clipped or bridged
    acc_doubt: Array  # (n, S)

    def __len__(self) -> int:
        return len(self.gyr)


@dataclass(frozen=True)
class Problem:
    """Readings of a chain's sensors with their noise, and the priors, SI."""

    chain: Chain
    noise: Noise
    dt: float  # s
    turns: Array  # (n-1, S, 3) rad, rotation vectors between samples, biases in them
    # (n-1, S, 3) rad/s, by how much a turn grows for each s that gyroscopes lag behind
    later: Array
    acc: Array  # (n, S, 3) m/s^2
    turn_sd: Array  # (n-1, S) rad
    acc_sd: Array  # (n, S) m/s^2
    start: Array  # (S, 4) q_GS of the first sample, prior
    distal: Array  # (S, 3) unit, where the nominal mounting has the segment's distal end, in the sensor's frame
    flexing: Array  # (S, 3) unit, nominal flexion axis of the segment, in the sensor's frame
    bias_prior: Array  # (S, 3) rad/s, what gyroscopes read at rest, else 0
    bias_sd: float  # rad/s
    bent: Array  # (n, J) rad, flexion of each joint by the last estimate: the skin follows it
    by_tilt: Array  # (n, J, 2) rad/rad, how that changes with the tilt of the axis about which it is counted
    tilt: Array  # (J, 2) rad, tilt at which `bent` was counted
    mounting_sd: Array  # (S,) rad, how far a sensor may sit off its nominal mounting
    length: Array  # (S,) m, of segments as given; NaN where nothing is
    length_sd: Array  # (S,) m

    def __len__(self) -> int:
        return len(self.acc)


@dataclass(frozen=True)
class Unknowns:
    """What self-calibration estimates: orientations q_GS and parameters, SI."""

    q_GS: Array  # (n, S, 4) orientations of the sensors
    far: Array  # (J, 3) m, from the parent's sensor to the joint's centre, in the sensor's frame
    near: Array  # (J, 3) m, from the child's sensor
    bias_gyr: Array  # (S, 3) rad/s
    bias_acc: Array  # (S, 3) m/s^2
    scale_gyr: (
        Array  # (S, 3, 3) scale errors and misalignment of the axes: relative correction of a rate
    )
    scale_acc: Array  # (S, 3, 3) the same of a specific force
    axis_far: Array  # (H, 3) unit, axis of a hinge in the frame of the parent's sensor
    axis_near: Array  # (H, 3) unit, in that of the child's
    # (J, 3) rad/rad, how far the child's sensor turns with its joint, in its frame
    skin_turn: Array
    skin_slide: Array  # (J, 3) m/rad, how far it slides
    delay: Array  # (1,) s by which gyroscopes lag behind accelerometers
    tilt: Array  # (J, 2) rad, of the flexion axis of a joint that is no hinge, off the nominal one; skin follows that flexion
    law: (
        Array  # (J,) non-linearity: relative excess of the skin's displacement at 90 deg of flexion
    )


@dataclass(frozen=True)
class Columns:
    """Columns of the parameters in their increment (P,)."""

    far: slice
    near: slice
    bias_gyr: slice
    bias_acc: slice
    scale_gyr: slice
    scale_acc: slice
    axis_far: slice
    axis_near: slice
    skin_turn: slice
    skin_slide: slice
    delay: slice
    tilt: slice
    law: slice

    @property
    def count(self) -> int:
        return int(self.law.stop)


def build_chain(
    segments: Sequence[str],
    joints: Sequence[str] | None = None,
    hinges: Sequence[str] | None = None,
) -> Chain:
    """The tree of those `segments` that are connected to the first; hinges are those of the hand's anatomy unless given.

    With the hand as the first the forearm is its child through the wrist.
    """
    known = [j for j in JOINTS if joints is None or j.name in joints]
    sensors, links, ends = [segments[0]], [], []
    for joint in known:
        for near, far in ((joint.parent, joint.child), (joint.child, joint.parent)):
            if near in sensors and far in segments and far not in sensors:
                sensors.append(far)
                links.append(joint)
                ends.append((near, far))
    row = {name: k for k, name in enumerate(sensors)}
    turning = {j.name for j in links if len(j.dofs) == 1} if hinges is None else set(hinges)
    return Chain(
        tuple(sensors),
        tuple(j.name for j in links),
        np.array([row[near] for near, _ in ends], dtype=np.intp),
        np.array([row[far] for _, far in ends], dtype=np.intp),
        np.flatnonzero([j.name in turning for j in links]),
    )


def build_problem(
    chain: Chain,
    noise: Noise,
    readings: Readings,
    start: Array,
    hand: Hand,
    mounting: Mapping[str, Array],
) -> Problem:
    """The problem of these readings; orientations begin near `start` (S, 4); `mounting` is the nominal one, q_BS by segment."""
    bias_prior, bias_sd = estimate_rest_bias(noise, readings)
    w, dt = readings.gyr, readings.dt
    between = dt * readings.gyr_doubt
    return Problem(
        chain,
        noise,
        dt,
        integrate_rates(w, dt),
        np.diff(w, axis=0),
        readings.acc,
        noise.gyr * np.sqrt(0.5 * (between[1:] ** 2 + between[:-1] ** 2)),
        noise.acc * readings.acc_doubt,
        start,
        side_sign(hand) * axis_in_sensors(chain, mounting, np.array([0.0, 1.0, 0.0])),
        axis_in_sensors(chain, mounting, Z),
        bias_prior,
        bias_sd,
        np.zeros((len(readings), len(chain.joints))),
        np.zeros((len(readings), len(chain.joints), 2)),
        np.zeros((len(chain.joints), 2)),
        np.full(len(chain.sensors), np.radians(noise.mounting)),
        np.full(len(chain.sensors), np.nan),
        np.full(len(chain.sensors), 1e-3 * noise.length),
    )


def axis_in_sensors(chain: Chain, mounting: Mapping[str, Array], axis: Array) -> Array:
    """An axis (3,) of the segments in the frames of their sensors (S, 3), as the nominal mounting has it."""
    q_BS = quat.normalize(np.array([mounting.get(s, quat.IDENTITY) for s in chain.sensors], float))
    return quat.rotate(quat.conjugate(q_BS), axis)


def with_lengths(problem: Problem, lengths: Mapping[str, float]) -> Problem:
    """The problem with lengths of segments given, m by segment."""
    return replace(
        problem, length=np.array([lengths.get(s, np.nan) for s in problem.chain.sensors], float)
    )


def estimate_rest_bias(noise: Noise, readings: Readings) -> tuple[Array, float]:
    """Biases of gyroscopes (S, 3) rad/s and their standard deviation, from the seconds in which every sensor rests; zero with the prior's deviation where none is."""
    each = max(1, round(1 / readings.dt))
    seconds = len(readings) // each
    gyr, acc = (
        v[: seconds * each].reshape(seconds, each, *v.shape[1:])
        for v in (readings.gyr, readings.acc)
    )
    still = (gyr.std(axis=1).max(axis=(1, 2)) < np.radians(RESTING_GYR)) & (
        acc.std(axis=1).max(axis=(1, 2)) < RESTING_ACC
    )
    if not still.any():
        return np.zeros(readings.gyr.shape[1:]), float(np.radians(noise.gyr_bias))
    return gyr[still].mean(axis=(0, 1)), float(np.radians(noise.rest))


def with_noise(problem: Problem, noise: Noise, acc_doubt: Array | float = 1.0) -> Problem:
    """The same readings with other sizes of errors; those of accelerations are multiplied by factors (n, S)."""
    grown = problem.acc_sd * noise.acc / problem.noise.acc * acc_doubt
    return replace(
        problem, noise=noise, turn_sd=problem.turn_sd * noise.gyr / problem.noise.gyr, acc_sd=grown
    )


def integrate_rates(w: Array, dt: float) -> Array:
    """Rotation vectors (n-1, ..., 3) between samples of a rate (n, ..., 3): cubics through four samples, the axis' own movement to second order."""
    mean = 0.5 * (w[1:] + w[:-1])
    mean[1:-1] = (13 * (w[1:-2] + w[2:-1]) - (w[:-3] + w[3:])) / 24
    return np.asarray(dt * mean + dt**2 / 12 * quat.cross(w[:-1], w[1:]))


def parameter_columns(chain: Chain) -> Columns:
    """The layout of the parameters' increment."""
    J, S, H = len(chain.joints), len(chain.sensors), len(chain.hinges)
    ends = np.cumsum(
        [0, 3 * J, 3 * J, 3 * S, 3 * S, 9 * S, 9 * S, 2 * H, 2 * H, 3 * J, 3 * J, 1, 2 * J, J]
    ).tolist()
    return Columns(*(slice(a, b) for a, b in zip(ends, ends[1:])))


def apply_increment(at: Unknowns, chain: Chain, turns: Array, parameters: Array) -> Unknowns:
    """The unknowns after an increment: `turns` (n, S, 3) rad in the sensors' frames, parameters (P,); unit vectors stay on their sphere."""
    c = parameter_columns(chain)
    return replace(
        at,
        q_GS=quat.normalize(quat.multiply(at.q_GS, quat.exp(turns))),
        far=at.far + parameters[c.far].reshape(-1, 3),
        near=at.near + parameters[c.near].reshape(-1, 3),
        bias_gyr=at.bias_gyr + parameters[c.bias_gyr].reshape(-1, 3),
        bias_acc=at.bias_acc + parameters[c.bias_acc].reshape(-1, 3),
        scale_gyr=at.scale_gyr + parameters[c.scale_gyr].reshape(-1, 3, 3),
        scale_acc=at.scale_acc + parameters[c.scale_acc].reshape(-1, 3, 3),
        axis_far=tilt_axes(at.axis_far, parameters[c.axis_far].reshape(-1, 2)),
        axis_near=tilt_axes(at.axis_near, parameters[c.axis_near].reshape(-1, 2)),
        skin_turn=at.skin_turn + parameters[c.skin_turn].reshape(-1, 3),
        skin_slide=at.skin_slide + parameters[c.skin_slide].reshape(-1, 3),
        delay=at.delay + parameters[c.delay],
        tilt=at.tilt + parameters[c.tilt].reshape(-1, 2),
        law=at.law + parameters[c.law],
    )


def tilt_axes(axes: Array, by: Array) -> Array:
    """Unit vectors (m, 3) moved on their sphere by (m, 2) rad along `tangents`."""
    along = np.einsum("mij,mj->mi", tangents(axes), by)
    size = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.cos(size) * axes + np.sinc(size / np.pi) * along)


def tangents(axes: Array) -> Array:
    """Two unit vectors square to each axis (m, 3), as columns (m, 3, 2)."""
    if not len(axes):
        return np.empty((0, 3, 2))
    first = _cross(axes, np.eye(3)[np.argmin(np.abs(axes), axis=-1)])
    first /= np.sqrt((first * first).sum(axis=-1, keepdims=True))
    return np.stack([first, _cross(axes, first)], axis=-1)


def _cross(a: Array, b: Array) -> Array:
    """Cross product of vectors (m, 3); numpy's takes ten times as long for a few."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def with_flexion(problem: Problem, at: Unknowns) -> Problem:
    """The same problem with joints flexed (n, J) as here: between the bones on either side, a nominal direction where a segment shows none."""
    chain, q_GS = problem.chain, remove_soft_tissue(problem, at)
    found, by_tilt = np.empty_like(problem.bent), np.zeros_like(problem.by_tilt)
    hinge = {int(k): h for h, k in enumerate(chain.hinges)}
    for k, (i, j) in enumerate(zip(chain.parents, chain.children)):
        before, behind = (
            quat.rotate(q_GS[:, s], _bone_direction(problem, at, int(s))) for s in (i, j)
        )
        if k in hinge:
            axis = at.axis_far[hinge[k]] * (
                1.0 if at.axis_far[hinge[k]] @ problem.flexing[i] >= 0 else -1.0
            )
            found[:, k] = _flexion_angle(quat.rotate(q_GS[:, i], axis), before, behind)
            continue
        axes = tilt_axes(
            np.tile(problem.flexing[i], (3, 1)),
            at.tilt[k] + TILTING * np.array([[0, 0], [1, 0], [0, 1]]),
        )
        found[:, k], *others = (
            _flexion_angle(quat.rotate(q_GS[:, i], axis), before, behind) for axis in axes
        )
        by_tilt[:, k] = np.stack([other - found[:, k] for other in others], axis=1) / TILTING
    return replace(problem, bent=found, by_tilt=by_tilt, tilt=at.tilt)


def flexion_at(problem: Problem, samples: Indices) -> Problem:
    """The problem with the flexion of joints at some samples."""
    return replace(problem, bent=problem.bent[samples], by_tilt=problem.by_tilt[samples])


def _flexion_angle(z: Array, before: Array, behind: Array) -> Array:
    """How far the second direction is turned from the first about a third, all (n, 3): (n,) rad."""
    side = np.einsum("ni,ni->n", z, quat.cross(before, behind))
    along = np.einsum("ni,ni->n", before, behind) - np.einsum("ni,ni->n", z, before) * np.einsum(
        "ni,ni->n", z, behind
    )
    return np.asarray(np.arctan2(side, along))


def joint_flexion(problem: Problem, at: Unknowns, samples: Indices) -> Array:
    """Flexion of joints (..., J) rad at samples (...), about the tilted axes."""
    return np.asarray(
        problem.bent[samples]
        + np.einsum("...jx,jx->...j", problem.by_tilt[samples], at.tilt - problem.tilt)
    )


def remove_soft_tissue(problem: Problem, at: Unknowns) -> Array:
    """Orientations (n, S, 4) that the sensors would have if no skin turned them on their segments."""
    back = np.zeros(at.q_GS.shape[:2] + (3,))
    back[:, problem.chain.children] = (
        -tissue_response(joint_flexion(problem, at, np.arange(len(back))), at.law)[..., None]
        * at.skin_turn
    )
    return quat.multiply(at.q_GS, quat.exp(back))


def _bone_direction(problem: Problem, at: Unknowns, s: int) -> Array:
    """The distal direction (3,) of a sensor's segment in the sensor's frame."""
    before, behind = (
        np.flatnonzero(problem.chain.children == s),
        np.flatnonzero(problem.chain.parents == s),
    )
    if len(before) != 1 or len(behind) != 1:
        return np.asarray(problem.distal[s])
    bone = at.far[behind[0]] - at.near[before[0]]
    return np.asarray(bone / (np.linalg.norm(bone) + 1e-12))
