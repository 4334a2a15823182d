"""The residuals of self-calibration with their derivatives, each divided by its standard deviation.

In      a Problem, Unknowns, a stretch of samples
Out     Terms: residuals of consecutive samples and their derivatives by the orientations of one to three samples and by the parameters
Source  Kortier, thesis ch. 4; his numbers stand at each function
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import compiled_terms, soft_tissue
from handscope.estimators.self_calibration.compiled_terms import Arms, Axes, Motion, Tree, Turns
from handscope.estimators.self_calibration.problem import (
    Chain,
    Columns,
    Problem,
    Unknowns,
    joint_flexion,
    parameter_columns,
    tangents,
)
from handscope.estimators.self_calibration.soft_tissue import SensorDisplacement, right_jacobian

SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])
# p(t+T) - 2 p(t) + p(t-T) = T^2 times this mean of the accelerations, to T^6: Numerov 1924
NUMEROV = np.array([1.0, 10.0, 1.0]) / 12
# rad: (4.16); the root's heading is free (no magnetometer) and is held at what was first believed
BEGINNING_SD, HEADING_SD = 1.0, 1e-3


@dataclass(frozen=True)
class Terms:
    """Residuals of m rows at each of T samples, each touching the orientations of `knots` samples from `first` on."""

    first: int
    knots: int
    r: Array  # (T, m)
    by_turns: Array  # (T, m, knots * S * 3)
    by_parameters: Array  # (T, m, len(cols))
    cols: Indices  # columns of the parameters' increment


def gyroscope_terms(problem: Problem, at: Unknowns, start: int, stop: int) -> Terms:
    """(4.8), (4.17c): between two samples a sensor turns by what its gyroscope read less its bias."""
    S, c = len(problem.chain.sensors), parameter_columns(problem.chain)
    T = max(min(stop, len(problem) - 1) - start, 0)
    by, by_parameters = np.zeros((T, S, 3, 2, S, 3)), np.zeros((T, S, 3, 12 * S + 1))
    r = np.empty((T, S, 3))
    compiled_terms.fill_turns(_turns(problem, at, start, start + T), r, by, by_parameters)
    return Terms(
        start,
        2,
        r.reshape(T, 3 * S),
        by.reshape(T, 3 * S, 6 * S),
        by_parameters.reshape(T, 3 * S, 12 * S + 1),
        _column_indices(c.bias_gyr, c.scale_gyr, c.delay),
    )


def gyroscope_residuals(problem: Problem, at: Unknowns, start: int, stop: int) -> Array:
    """The residuals (T, 3 S) of `gyroscope_terms` alone."""
    T = max(min(stop, len(problem) - 1) - start, 0)
    r = np.empty((T, len(problem.chain.sensors), 3))
    compiled_terms.fill_turns(
        _turns(problem, at, start, start + T),
        r,
        np.empty((0, 0, 3, 2, 0, 3)),
        np.empty((0, 0, 3, 0)),
    )
    return r.reshape(T, 3 * r.shape[1])


def _turns(problem: Problem, at: Unknowns, start: int, stop: int) -> Turns:
    felt, later = problem.turns[start:stop], problem.later[start:stop]
    corrected = (
        felt
        + np.einsum("sij,tsj->tsi", at.scale_gyr, felt)
        - problem.dt * at.bias_gyr
        + at.delay * later
    )
    return Turns(
        at.q_GS[start : stop + 1], felt, corrected, later, problem.turn_sd[start:stop], problem.dt
    )


def joint_acceleration_terms(problem: Problem, at: Unknowns, start: int, stop: int) -> Terms:
    """(4.9), (4.10b), (4.11), (4.12), (4.17a, b): the two segments of a joint have its centre in common, always, so their accelerations there agree.

    The place of a joint is that of a sensor and an arm in its frame; its second difference over three samples is exact (Numerov), no rate is
    differentiated, gravity cancels. A sensor's noise is seen by all of its joints: the rows of a sample are whitened together. Noise grows with the accelerometers' common
    scale: without that a small world would look like a quiet one.
    """
    chain, c = problem.chain, parameter_columns(problem.chain)
    start, stop = max(start, 1), min(stop, len(problem) - 1)
    T, J, S = max(stop - start, 0), len(chain.joints), len(chain.sensors)
    samples = np.arange(start - 1, start + T + 1)
    by_turns, by_parameters = np.empty((T, J, 3, 9 * S)), np.empty((T, J, 3, 15 * J + 12 * S))
    r, grown = joint_acceleration_residuals(problem, at, start, stop), common_scale(at)
    compiled_terms.fill_joint_accelerations(
        tree(chain),
        motion(problem, at, samples),
        Arms(at.far, at.near, at.skin_turn, at.skin_slide),
        np.stack([SECOND_DIFFERENCE / problem.dt**2, NUMEROV]),
        whitening_matrix(problem, start, stop) / grown,
        by_turns,
        by_parameters,
    )
    mixed = by_parameters.reshape(T, 3 * J, 15 * J + 12 * S)
    mixed[..., 15 * J + 3 * S :] -= r[..., None] * np.tile(np.eye(3).ravel(), S) / (3 * S * grown)
    cols = _column_indices(
        c.far, c.near, c.skin_turn, c.skin_slide, c.tilt, c.law, c.bias_acc, c.scale_acc
    )
    return Terms(start - 1, 3, r, by_turns.reshape(T, 3 * J, 9 * S), mixed, cols)


def tree(chain: Chain) -> Tree:
    """The chain as compiled loops take it."""
    before = np.full(len(chain.sensors), -1, np.intp)
    before[chain.children] = np.arange(len(chain.joints))
    return Tree(chain.parents, chain.children, before)


def motion(problem: Problem, at: Unknowns, samples: Indices) -> Motion:
    """The sensors at these samples."""
    S, read = len(problem.chain.sensors), problem.acc[samples]
    bent = soft_tissue.tissue_response(joint_flexion(problem, at, samples), at.law)
    turn, slide = np.zeros((2, len(samples), S, 3))
    turn[:, problem.chain.children] = bent[..., None] * at.skin_turn
    slide[:, problem.chain.children] = bent[..., None] * at.skin_slide
    return Motion(
        quat.matrix(at.q_GS[samples]),
        read,
        _specific_force(at, read),
        bent,
        _response_derivatives(problem, at, samples),
        quat.matrix(quat.exp(-turn)),
        slide,
        right_jacobian(-turn),
    )


def joint_acceleration_residuals(problem: Problem, at: Unknowns, start: int, stop: int) -> Array:
    """The residuals (T, 3 J) of `joint_acceleration_terms` alone."""
    chain, start, stop = problem.chain, max(start, 1), min(stop, len(problem) - 1)
    R, f = (
        quat.matrix(at.q_GS[start - 1 : stop + 1]),
        _specific_force(at, problem.acc[start - 1 : stop + 1]),
    )
    samples, e = np.arange(start - 1, stop + 1), np.zeros((stop - start, len(chain.joints), 3))
    pulled = [_sensor_displacement(problem, at, s, samples) for s in range(len(chain.sensors))]
    for k in range(len(chain.joints)):
        for sign, s, still in (
            (1.0, chain.children[k], at.near[k]),
            (-1.0, chain.parents[k], at.far[k]),
        ):
            arm = np.einsum("tij,tj->ti", R[:, s], soft_tissue.place_in_sensor(pulled[s], still))
            force = np.einsum("tij,tj->ti", R[:, s], f[:, s])
            e[:, k] += sign * (
                sum_over_three(SECOND_DIFFERENCE / problem.dt**2, arm)
                + sum_over_three(NUMEROV, force)
            )
    white = whitening_matrix(problem, start, stop) @ e
    return np.asarray(white.reshape(len(e), 3 * len(chain.joints)) / common_scale(at))


def sum_over_three(weights: Array, v: Array) -> Array:
    """The weighted sum (n - 2, ...) of each three samples that follow one another, of (n, ...)."""
    return np.asarray(weights[0] * v[:-2] + weights[1] * v[1:-1] + weights[2] * v[2:])


def common_scale(at: Unknowns) -> float:
    """Of the accelerometers, as it is being estimated."""
    return float(1 + np.trace(at.scale_acc, axis1=1, axis2=2).mean() / 3)


def _sensor_displacement(
    problem: Problem, at: Unknowns, s: int, samples: Indices
) -> SensorDisplacement:
    """Of a sensor at samples (...), pulled by the joint before its segment, if one is."""
    before = problem.chain.children == s
    return soft_tissue.displace_sensor(
        soft_tissue.tissue_response(joint_flexion(problem, at, samples), at.law)[..., before],
        at.skin_turn[before],
        at.skin_slide[before],
    )


def _response_derivatives(problem: Problem, at: Unknowns, samples: Indices) -> Array:
    """How far skin follows each joint at samples (...), derivatives (..., J, 3) by the joint's tilt (2) and its law."""
    by_bending, law = soft_tissue.tissue_response_derivatives(
        joint_flexion(problem, at, samples), at.law
    )
    return np.concatenate(
        [by_bending[..., None] * problem.by_tilt[samples], law[..., None]], axis=-1
    )


def whitening_matrix(problem: Problem, start: int, stop: int) -> Array:
    """What makes the joints' rows (T, J, J) of one size and independent: the inverse root of the covariance that the sensors' noise has at the joints."""
    v = problem.acc_sd**2
    share = NUMEROV**2 / (NUMEROV**2).sum()
    v = (
        share[0] * v[start - 1 : stop - 1]
        + share[1] * v[start:stop]
        + share[2] * v[start + 1 : stop + 1]
    )
    a = problem.chain.incidence
    return np.asarray(np.linalg.inv(np.linalg.cholesky((a * v[:, None]) @ a.T)))


def hinge_terms(problem: Problem, at: Unknowns, start: int, stop: int) -> Terms:
    """(4.10a), (4.13): both segments of a hinge have its axis in common."""
    chain, c = problem.chain, parameter_columns(problem.chain)
    T, H = max(min(stop, len(problem)) - start, 0), len(chain.hinges)
    J, S = len(chain.joints), len(chain.sensors)
    by, by_parameters = np.zeros((T, H, 3, S, 3)), np.zeros((T, H, 3, 4 * H + 6 * J))
    r = _fill_hinges(problem, at, np.arange(start, start + T), by, by_parameters)
    cols = _column_indices(c.axis_far, c.axis_near, c.skin_turn, c.tilt, c.law)
    return Terms(
        start,
        1,
        r.reshape(T, 3 * H),
        by.reshape(T, 3 * H, 3 * S),
        by_parameters.reshape(T, 3 * H, 4 * H + 6 * J),
        cols,
    )


def hinge_residuals(problem: Problem, at: Unknowns, start: int, stop: int) -> Array:
    """The residuals (T, 3 H) of `hinge_terms` alone."""
    samples = np.arange(start, max(min(stop, len(problem)), start))
    r = _fill_hinges(problem, at, samples, np.empty((0, 0, 3, 0, 3)), np.empty((0, 0, 3, 0)))
    return r.reshape(len(r), 3 * r.shape[1])


def _fill_hinges(
    problem: Problem, at: Unknowns, samples: Indices, by_turns: Array, by_parameters: Array
) -> Array:
    """Residuals (T, H, 3); fills the derivatives."""
    r = np.empty((len(samples), len(problem.chain.hinges), 3))
    compiled_terms.fill_hinges(
        tree(problem.chain),
        motion(problem, at, samples),
        Axes(
            problem.chain.hinges,
            at.axis_far,
            at.axis_near,
            tangents(at.axis_far),
            tangents(at.axis_near),
        ),
        at.skin_turn,
        float(np.radians(problem.noise.hinge)),
        r,
        by_turns,
        by_parameters,
    )
    return r


def mean_acceleration_terms(problem: Problem, at: Unknowns, start: int, stop: int) -> Terms:
    """(4.15): the root's acceleration is zero on average; this makes the vertical, and by gravity the scale, observable.

    Its size grows with the accelerometers' common scale, as noise does in `joint_acceleration_terms`: a small world would look like one that stays.
    """
    c, S = parameter_columns(problem.chain), len(problem.chain.sensors)
    stop = min(stop, len(problem))
    grown = common_scale(at)
    sd = problem.noise.still * grown
    read = problem.acc[start:stop]
    R, f = quat.matrix(at.q_GS[start:stop, 0]), _specific_force(at, read)[:, 0]
    r = (np.einsum("tij,tj->ti", R, f) - [0.0, 0.0, GRAVITY]) / sd
    by = np.zeros((stop - start, 3, S, 3))
    by[:, :, 0] = -R @ quat.skew(f) / sd
    scaled = -r[..., None] * np.tile(np.eye(3).ravel(), S) / (3 * S * grown)
    scaled[..., :9] += (R[..., None] * read[:, 0, None, None] / sd).reshape(-1, 3, 9)
    cols = np.concatenate(
        [c.bias_acc.start + np.arange(3), np.arange(c.scale_acc.start, c.scale_acc.stop)]
    )
    return Terms(
        start,
        1,
        r,
        by.reshape(stop - start, 3, 3 * S),
        np.concatenate([-R / sd, scaled], axis=2),
        cols,
    )


def _specific_force(at: Unknowns, read: Array) -> Array:
    """Specific forces (T, S, 3) of what accelerometers read."""
    return np.asarray(read + np.einsum("sij,tsj->tsi", at.scale_acc, read) - at.bias_acc)


def initial_orientation_terms(problem: Problem, at: Unknowns, start: int, stop: int) -> Terms:
    """(4.16): where the sensors begin, as good as not known; but for the root's heading, that nothing else tells."""
    S, T = len(problem.chain.sensors), int(start == 0)
    sd = np.full((S, 3), BEGINNING_SD)
    sd[0, 2] = HEADING_SD
    off = quat.log(quat.multiply(at.q_GS[:T], quat.conjugate(problem.start)))
    by = np.zeros((T, S, 3, S, 3))
    turned = (
        inverse_jacobian(-off) @ quat.matrix(quat.normalize(at.q_GS[:T]))
        if T
        else np.empty((0, S, 3, 3))
    )
    for s in range(S):
        by[:, s, :, s] = turned[:, s] / sd[s, :, None]
    return Terms(
        0,
        1,
        (off / sd).reshape(T, 3 * S),
        by.reshape(T, 3 * S, 3 * S),
        np.empty((T, 3 * S, 0)),
        np.empty(0, np.intp),
    )


def residuals_alone(
    kind: Callable[[Problem, Unknowns, int, int], Terms],
) -> Callable[[Problem, Unknowns, int, int], Array]:
    """What gives the residuals (T, m) of a kind without their derivatives, which are most of the work."""
    if kind is gyroscope_terms:
        return gyroscope_residuals
    if kind is joint_acceleration_terms:
        return joint_acceleration_residuals
    if kind is hinge_terms:
        return hinge_residuals
    return lambda *where: kind(*where).r


EVERY_SAMPLE: tuple[Callable[[Problem, Unknowns, int, int], Terms], ...] = (
    gyroscope_terms,
    joint_acceleration_terms,
    hinge_terms,
    mean_acceleration_terms,
    initial_orientation_terms,
)


def prior_residuals(problem: Problem, at: Unknowns) -> tuple[Array, Array]:
    """(4.3.1) and what defines the segments' frames: residuals (m,) and their derivatives by the parameters (m, P)."""
    chain, noise, c = problem.chain, problem.noise, parameter_columns(problem.chain)
    sizes = (
        (c.far, at.far, noise.place),
        (c.near, at.near, noise.place),
        (c.bias_gyr, at.bias_gyr - problem.bias_prior, problem.bias_sd),
        (c.bias_acc, at.bias_acc, noise.acc_bias),
        (c.scale_gyr, at.scale_gyr, noise.scale),
        (c.scale_acc, at.scale_acc, noise.scale),
        (c.skin_turn, at.skin_turn, np.radians(noise.skin_turn) / (np.pi / 2)),
        (c.skin_slide, at.skin_slide, 1e-3 * noise.skin_slide / (np.pi / 2)),
        (c.delay, at.delay, 1e-3 * noise.delay),
        (c.tilt, at.tilt, np.repeat(problem.mounting_sd[chain.parents], 2)),
        (c.law, at.law, noise.skin_law),
    )
    r, by = [], []
    for where, value, sd in sizes:
        flat = np.ravel(value)
        r.append(flat / sd)
        by.append(np.eye(c.count)[where] / np.reshape(sd, (-1, 1)))
    for h in range(len(chain.hinges)):
        for off, slope in _frame_constraints(problem, at, c, h):
            r.append(np.array([off]))
            by.append(slope[None])
    for prior in (*mounting_priors(problem, at), *length_priors(problem, at)):
        r.append(prior.off / prior.sd)
        by.append(prior.by_parameters / prior.sd)
    return np.concatenate(r), np.concatenate(by)


@dataclass(frozen=True)
class PriorResidual:
    """Residual of prior knowledge: a mounting or a length."""

    sensor: int
    off: Array  # (m,) rad, m
    sd: float
    by_parameters: Array  # (m, P)


def mounting_priors(problem: Problem, at: Unknowns) -> list[PriorResidual]:
    """Known mounting: hinges' axes and bones (3,) lie in their sensors as the nominal mounting has them, whichever way an axis points."""
    chain, c, priors = problem.chain, parameter_columns(problem.chain), []
    for h, joint in enumerate(chain.hinges):
        for s, axis, place in (
            (int(chain.parents[joint]), at.axis_far[h], c.axis_far.start + 2 * h),
            (int(chain.children[joint]), at.axis_near[h], c.axis_near.start + 2 * h),
        ):
            nominal = problem.flexing[s] * (1.0 if axis @ problem.flexing[s] >= 0 else -1.0)
            slope = np.zeros((3, c.count))
            slope[:, place : place + 2] = quat.skew(nominal) @ tangents(axis[None])[0]
            priors.append(
                PriorResidual(s, np.cross(nominal, axis), float(problem.mounting_sd[s]), slope)
            )
    for s, b, a in bones(chain):
        along = at.far[a] - at.near[b]
        size = float(np.linalg.norm(along)) + 1e-12
        unit = along / size
        slope = np.zeros((3, c.count))
        turned = quat.skew(problem.distal[s]) @ (np.eye(3) - np.outer(unit, unit)) / size
        slope[:, c.far.start + 3 * a : c.far.start + 3 * a + 3] = turned
        slope[:, c.near.start + 3 * b : c.near.start + 3 * b + 3] = -turned
        priors.append(
            PriorResidual(
                s, np.cross(problem.distal[s], unit), float(problem.mounting_sd[s]), slope
            )
        )
    return priors


def length_priors(problem: Problem, at: Unknowns) -> list[PriorResidual]:
    """Known lengths: a segment's two joints lie as far apart as was measured (1,)."""
    c, priors = parameter_columns(problem.chain), []
    for s, b, a in bones(problem.chain):
        along = at.far[a] - at.near[b]
        size = float(np.linalg.norm(along)) + 1e-12
        slope = np.zeros((1, c.count))
        slope[0, c.far.start + 3 * a : c.far.start + 3 * a + 3] = along / size
        slope[0, c.near.start + 3 * b : c.near.start + 3 * b + 3] = -along / size
        if np.isfinite(problem.length[s]):
            priors.append(
                PriorResidual(
                    s, np.array([size - problem.length[s]]), float(problem.length_sd[s]), slope
                )
            )
    return priors


def bones(chain: Chain) -> list[tuple[int, int, int]]:
    """Sensors of segments between two joints: row, joint before, joint behind."""
    found = []
    for s in range(len(chain.sensors)):
        before, after = np.flatnonzero(chain.children == s), np.flatnonzero(chain.parents == s)
        if len(before) == 1 and len(after) == 1:
            found.append((s, int(before[0]), int(after[0])))
    return found


def _frame_constraints(
    problem: Problem, at: Unknowns, c: Columns, h: int
) -> list[tuple[float, Array]]:
    """No movement shows the centre's place along a hinge's axis: by definition the axis is square to the bones, and the sensors lie over them."""
    chain, joint, constraints = problem.chain, int(problem.chain.hinges[h]), []
    for s, axis, place in (
        (chain.parents[joint], at.axis_far[h], c.axis_far.start + 2 * h),
        (chain.children[joint], at.axis_near[h], c.axis_near.start + 2 * h),
    ):
        before, after = np.flatnonzero(chain.children == s), np.flatnonzero(chain.parents == s)
        arms = [(1.0, at.near[k], c.near.start + 3 * k) for k in before] + [
            (1.0, at.far[k], c.far.start + 3 * k) for k in after
        ]
        sums = [([arm], problem.noise.aside) for arm in arms]
        if len(before) == 1 and len(after) == 1:  # a bone between two joints
            sums.append(([(-1.0, *arms[0][1:]), arms[1]], problem.noise.bone))
        for parts, sd in sums:
            along: Array = np.sum([sign * arm for sign, arm, _ in parts], axis=0)
            slope = np.zeros(c.count)
            for sign, _, column in parts:
                slope[column : column + 3] = sign * axis
            slope[place : place + 2] = tangents(axis[None])[0].T @ along
            constraints.append((float(along @ axis) / (1e-3 * sd), slope / (1e-3 * sd)))
    return constraints


def inverse_jacobian(v: Array) -> Array:
    """The inverse of right_jacobian(v) (..., 3, 3). Source: Sola et al. 2018, (144)."""
    size = np.linalg.norm(v, axis=-1)[..., None, None]
    small = size < 1e-3
    safe = np.where(small, 1.0, size)
    K = quat.skew(v)
    two = np.where(
        small, 1 / 12 + size**2 / 720, 1 / safe**2 - (1 + np.cos(safe)) / (2 * safe * np.sin(safe))
    )
    return np.asarray(np.eye(3) + 0.5 * K + two * K @ K)


def _column_indices(*slices: slice) -> Indices:
    return np.concatenate([np.arange(s.start, s.stop) for s in slices])
