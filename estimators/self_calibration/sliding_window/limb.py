"""One finger with the hand's sensor in a sliding window: initialisation, update with every few nodes, uncertainty.

In      Nodes of all sensors (streaming_samples.py), a Calibration from the initial pose, the estimated orientations of the sensors where a window begins
Out     Finger: its window, and what that says of its segments on the hand, lengths, standard deviations
Source  ours: started from the pose; estimator.py, segments.py and uncertainty/monte_carlo.py do the rest
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINT, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import with_finger_lengths
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import segments
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.problem import (
    Chain,
    Noise,
    Problem,
    Readings,
    Unknowns,
    apply_increment,
    build_chain,
    parameter_columns,
    with_lengths,
)
from handscope.estimators.self_calibration.sliding_window import (
    estimator as sliding_window_estimator,
)
from handscope.estimators.self_calibration.sliding_window.estimator import Window, WindowResult
from handscope.estimators.self_calibration.sliding_window.streaming_samples import Nodes
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty import posterior
from handscope.estimators.self_calibration.uncertainty.monte_carlo import DRAWS

MISFIT = 10.0  # usual errors of joints' accelerations: beyond, what was found is of no hand
EVERY = 25  # steps from one standard deviation to the next: they change slowly
ROUNDING = 1e-9  # of a variance
FIRST = (1, 2, 5)  # steps behind a beginning at which they change fast


@dataclass(frozen=True)
class Setting:
    """What all fingers share."""

    noise: Noise
    calibration: Calibration
    most: int  # samples of a window
    lag: int  # of them from the newest to the one that is given out
    straight: float  # rad, how far a joint may have been off in the pose
    length_guess: float  # relative error of a length that no movement determines


@dataclass(frozen=True)
class OutputUncertainty:
    """Standard deviations."""

    angles: Array  # (joints, 3) rad, NaN where it is no joint of this finger
    tip: Array  # (3,) m


@dataclass(frozen=True)
class Finger:
    """One finger's window, with its newest lengths (m)."""

    name: str
    chain: Chain
    window: Window | None = None  # none before it began, and while one of its sensors is silent
    known: Window | None = None  # the last one that was given up: parameters are not forgotten
    steps: int = 0  # since it began
    on_hand: Mapping[str, Array] | None = None  # (n, 4) by segment, of the window's samples
    lengths: Mapping[str, float] | None = None  # m
    sure: OutputUncertainty | None = None


def build_finger(finger: str, worn: set[str]) -> Finger | None:
    """A finger whose sensors hang together with the hand's; None where they do not."""
    links = (
        build_chain([s for s in ("hand", *CHAINS[finger]) if s in worn]) if "hand" in worn else None
    )
    return Finger(finger, links) if links is not None and len(links.joints) else None


def advance_finger(
    setting: Setting, finger: Finger, nodes: Nodes, q_GS: Array, sd: Array
) -> Finger:
    """With some nodes more, at least three; where a window begins the sensors are at the first of them as `q_GS` (segments, 4) has them, to `sd` (segments,) rad."""
    rows = [SEGMENT[s] for s in finger.chain.sensors]
    if nodes.lost[:, rows].any() or not np.isfinite(nodes.values[:, rows]).all():
        return close_window(finger)
    read = _select_readings(nodes, rows)
    try:
        if finger.window is None:
            if not np.isfinite(q_GS[rows]).all():
                return finger
            finger, rounds = (
                replace(
                    finger,
                    window=_start_window(
                        setting,
                        finger,
                        read,
                        q_GS[rows],
                        sd[rows],
                        bool(nodes.t[0] <= setting.calibration.end),
                    ),
                ),
                2,
            )
        else:
            finger, rounds = (
                replace(finger, window=sliding_window_estimator.extend_window(finger.window, read)),
                1,
            )
        assert finger.window is not None
        result = sliding_window_estimator.solve_window(
            finger.window, setting.most, rounds, setting.straight
        )
    except np.linalg.LinAlgError:
        return Finger(finger.name, finger.chain)
    if not result.misfit < MISFIT:
        return Finger(finger.name, finger.chain)
    return _read_window(setting, finger, result)


def close_window(finger: Finger) -> Finger:
    """Close the window of a silent sensor; its prior on the parameters stays."""
    return Finger(finger.name, finger.chain, known=finger.window or finger.known)


def _start_window(
    setting: Setting, finger: Finger, read: Readings, q_GS: Array, sd: Array, in_pose: bool
) -> Window:
    noise, calibration, sensors = setting.noise, setting.calibration, finger.chain.sensors
    guess, pose = (
        _initial_unknowns(calibration, finger, q_GS),
        np.array([calibration.q_GS.get(s, q) for s, q in zip(sensors, q_GS)]),
    )
    window = sliding_window_estimator.start_window(
        finger.chain,
        noise,
        read,
        guess,
        np.tile(sd[:, None], 3),
        pose,
        in_pose,
        calibration.hand,
        calibration.q_BS,
    )
    problem = with_lengths(
        window.problem, {s: calibration.geometry.lengths[s] for s in CHAINS[finger.name]}
    )
    problem = replace(
        problem,
        mounting_sd=np.array([_mounting_sd(setting, s) for s in sensors]),
        bias_sd=_bias_sd(setting, finger),
    )
    window = replace(window, problem=problem)
    return (
        window
        if finger.known is None
        else sliding_window_estimator.inherit_prior(window, finger.known)
    )


def _mounting_sd(setting: Setting, sensor: str) -> float:
    """Standard deviation of a sensor's mounting, rad: as its calibration has it, else the usual one."""
    measured_sd = setting.calibration.q_BS_sd.get(sensor)
    return float(
        np.radians(setting.noise.mounting)
        if measured_sd is None
        else np.sqrt(np.mean(np.square(measured_sd)))
    )


def _bias_sd(setting: Setting, finger: Finger) -> float:
    """Standard deviation of the biases after the pose, rad/s: from the farthest of three one-second means."""
    quality = [
        setting.calibration.quality[s]
        for s in finger.chain.sensors
        if s in setting.calibration.quality
    ]
    if len(quality) < len(finger.chain.sensors):
        return float(np.radians(setting.noise.gyr_bias))
    return float(
        np.hypot(np.radians(setting.noise.rest), np.mean([q.rate_wander for q in quality]) / 3)
    )


def _initial_unknowns(calibration: Calibration, finger: Finger, q_GS: Array) -> Unknowns:
    """Sensors in the middle of their segments, axes and biases as the pose has them."""
    links, geometry = finger.chain, calibration.geometry
    to_sensor = quat.conjugate(
        np.array([calibration.q_BS.get(s, quat.IDENTITY) for s in links.sensors])
    )
    ends = geometry.chain_offsets()[list(CHAINS).index(finger.name)] / 2
    half = {
        s: quat.rotate(to_sensor[k], ends[CHAINS[finger.name].index(s)])
        for k, s in enumerate(links.sensors)
        if k
    }
    knuckle = np.array(geometry.roots()[list(CHAINS).index(finger.name)]) - 0.5 * np.array(
        geometry.joint_positions["middle_mcp"]
    )
    far = [half.get(links.sensors[p], quat.rotate(to_sensor[0], knuckle)) for p in links.parents]
    near = [-half[links.sensors[c]] for c in links.children]
    z = quat.rotate(to_sensor, np.array([0.0, 0.0, 1.0]))
    S, J = len(links.sensors), len(links.joints)
    bias = np.array([calibration.gyr_bias.get(s, np.zeros(3)) for s in links.sensors])
    none, whole = np.zeros((J, 3)), np.zeros((S, 3, 3))
    axes = z[links.parents[links.hinges]], z[links.children[links.hinges]]
    return Unknowns(
        q_GS[None],
        np.array(far),
        np.array(near),
        bias,
        np.zeros((S, 3)),
        whole,
        whole,
        *axes,
        none,
        none,
        np.zeros(1),
        np.zeros((J, 2)),
        np.zeros(J),
    )


def _select_readings(nodes: Nodes, rows: list[int]) -> Readings:
    dt = float(np.mean(np.diff(nodes.t)))
    values, doubt = nodes.values[:, rows], nodes.doubt[:, rows]
    return Readings(dt, values[..., :3], values[..., 3:], doubt[..., 0], doubt[..., 1])


def _read_window(setting: Setting, finger: Finger, result: WindowResult) -> Finger:
    """Read segments, lengths and uncertainty from a solved window."""
    window, steps = result.window, finger.steps + 1
    on_hand, lengths = _segments_on_hand(
        setting, _solution(window.at, window.problem, result.factor), window.pose
    )
    sure = finger.sure
    if sure is None or steps in FIRST or steps % EVERY == 0:
        sure = _estimate_uncertainty(setting, finger, result)
    return replace(finger, window=window, steps=steps, on_hand=on_hand, lengths=lengths, sure=sure)


def _segments_on_hand(
    setting: Setting, solution: Solution, pose: Array
) -> tuple[dict[str, Array], Mapping[str, float]]:
    """Segments against the hand (n, 4), lengths. Where no joint shows how a sensor sits (the hand's, the last one's) the pose does."""
    calibration, sensors = setting.calibration, solution.problem.chain.sensors
    result = segments.of_solution(solution, calibration.hand, calibration.q_BS)
    q_GB = dict(result.q_GB)
    if len(sensors) > 2:
        first, before, last = 1, len(sensors) - 2, len(sensors) - 1
        for own, beside in ((0, first), (last, before)):
            straight = quat.multiply(pose[beside], quat.conjugate(result.q_BS[sensors[beside]]))
            q_GB_pose = quat.multiply(
                straight, _pose_rotation(calibration, sensors[beside], sensors[own])
            )
            again = quat.multiply(quat.conjugate(pose[own]), q_GB_pose)  # q_SB
            q_GB[sensors[own]] = quat.multiply(
                result.q_GB[sensors[own]], quat.multiply(result.q_BS[sensors[own]], again)
            )
    return {s: quat.relative(q_GB["hand"], q_GB[s]) for s in sensors[1:]}, result.lengths


def _solution(at: Unknowns, problem: Problem, factor: Factor) -> Solution:
    """The solution in the form that segments.py reads, without the unknowns of the pose."""
    P = parameter_columns(problem.chain).count
    return Solution(
        at, problem, "converged", (), replace(factor, covariance=factor.covariance[:P, :P])
    )


def _pose_rotation(calibration: Calibration, a: str, b: str) -> Array:
    """How segment b stood on a in the pose (4,)."""
    q_a, q_b = (
        quat.multiply(calibration.q_GS[s], quat.conjugate(calibration.q_BS[s]))
        if s in calibration.q_GS
        else None
        for s in (a, b)
    )
    return quat.IDENTITY if q_a is None or q_b is None else quat.relative(q_a, q_b)


def _estimate_uncertainty(
    setting: Setting, finger: Finger, result: WindowResult
) -> OutputUncertainty:
    """Standard deviations of the sample that is put out, by draws; where joints' accelerations err by more than assumed, all are inflated by as much."""
    window, n = result.window, len(result.window.problem)
    k = min(setting.lag + 1, n)
    at = replace(window.at, q_GS=window.at.q_GS[n - k : n - k + 1])
    one = slice(n - k, n - k + 1)
    problem = replace(
        window.problem,
        acc=window.problem.acc[one],
        bent=window.problem.bent[one],
        by_tilt=window.problem.by_tilt[one],
    )
    luck = posterior.normal_numbers(DRAWS, 1 << 15)
    angles, tip = _angles_and_tip(
        setting, finger, _solution(at, problem, result.factor), window.pose, 0.0
    )
    drawn = [
        _angles_and_tip(setting, finger, _solution(place, problem, result.factor), pose, lucky)
        for (place, pose), lucky in zip(
            _draw_places(
                at, window.pose, finger.chain, sliding_window_estimator.covariance(result.factor, k)
            ),
            luck,
        )
    ]
    wider, missed = max(1.0, result.misfit), np.zeros(angles.shape)
    ends = {finger.chain.joints[0], finger.chain.joints[-1]}  # their zero is the pose's
    missed[[JOINT[j] for j in ends]] = setting.straight
    angles_sd = wider * np.sqrt(np.mean([(a - angles) ** 2 for a, _ in drawn], axis=0))
    tip_sd = wider * np.sqrt(np.mean([(t - tip) ** 2 for _, t in drawn], axis=0))
    reach = sum(setting.calibration.geometry.lengths[s] for s in CHAINS[finger.name])
    return OutputUncertainty(
        np.hypot(angles_sd, missed), np.hypot(tip_sd, setting.straight * reach)
    )


def _angles_and_tip(
    setting: Setting, finger: Finger, solution: Solution, pose: Array, luck: float
) -> tuple[Array, Array]:
    """Angles (joints, 3), NaN where it is no joint of this finger, and the tip (3,), free of limits; `luck`, a standard normal number, stands for the error of lengths that no movement determines."""
    on_hand, lengths = _segments_on_hand(setting, solution, pose)
    q = np.full((len(SEGMENTS), 4), np.nan)
    q[SEGMENT["hand"]] = quat.IDENTITY
    for name, of_segment in on_hand.items():
        q[SEGMENT[name]] = of_segment[0]
    angles = np.where(IS_DOF, joint_angles.of_segments(q), 0.0)
    geometry = with_finger_lengths(
        setting.calibration.geometry, finger.name, lengths, setting.length_guess * luck
    )
    return angles, forward_kinematics.tips(joint_angles.compose(angles), geometry)[
        FINGERS.index(finger.name)
    ]


def _draw_places(
    at: Unknowns, pose: Array, links: Chain, P: Array
) -> Iterator[tuple[Unknowns, Array]]:
    """Places and poses as probable as a covariance of one sample's orientations, the parameters and the pose leaves them."""
    scale, e = np.sqrt(np.diag(P)), 3 * len(links.sensors)
    root = np.linalg.cholesky(P / np.outer(scale, scale) + ROUNDING * np.eye(len(P)))
    for which in range(DRAWS):
        step = scale * (root @ posterior.normal_numbers(len(P), which))
        yield (
            apply_increment(at, links, step[:e].reshape(1, -1, 3), step[e:-e]),
            quat.normalize(quat.multiply(pose, quat.exp(step[-e:].reshape(-1, 3)))),
        )
