"""Observability during free movement: standard deviations that self-calibration would reach, and excursions of joints.

In      even readings of a finger's sensors and the hand's over about a second, and their orientations at its beginning from live tracking
Out     AccumulatedInformation: information on the parameters, summed over stretches; from it standard deviations of lengths and places, by joint
Source  the residuals of self-calibration and their derivatives (residuals.py), the movement eliminated (normal_equations.py), spurious information
        subtracted (uncertainty/parameter_covariance.py), sizes of errors estimated as for a solution (uncertainty/posterior.py); what is enough: result.Requirements
Limits  each stretch turns as its gyroscopes say from where tracking has it, sensors sit in the middle of their segments: derivatives are those of a hand
        near the true one. Scale errors and lag count as known; sizes of errors are estimated from accelerations and hinges, to first order; skin is as
        soft as the prior has it, and the skin of the hand follows this finger alone
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration.messages import ROUNDED
from handscope.estimators.self_calibration.normal_equations import Factor, Step
from handscope.estimators.self_calibration.problem import (
    Chain,
    Noise,
    Problem,
    Readings,
    Unknowns,
    build_chain,
    build_problem,
    parameter_columns,
    with_flexion,
    with_lengths,
)
from handscope.estimators.self_calibration.residuals import NUMEROV, Terms
from handscope.estimators.self_calibration.result import Requirements
from handscope.estimators.self_calibration.uncertainty import parameter_covariance, posterior
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.problem import HandPlace

# per cent of the angles between which a joint's excursion lies, as of self-calibration
SPREAD = 1.0, 99.0
RIGID = 1e-3  # share of the skin's movement that is negligible
HANDS = 6  # parameters of the skin under the hand's sensor: turn and slide
# times what self-calibration asks a joint to be bent by, for tracking errs by a few degrees
SAFE = 4 / 3


@dataclass(frozen=True)
class Limb:
    """The prior of a finger."""

    links: Chain
    geometry: HandGeometry
    mounting: Mapping[str, Array]  # q_BS by segment
    hand_skin: float = 1.0  # how far skin moves the hand's sensor, share of what it does to the fingers'; 0: it sits on something rigid

    @property
    def selected(self) -> Indices:
        """Columns of the parameters that are looked at: all but scales and lag; behind them turn and slide of the skin under the hand's sensor."""
        c = parameter_columns(self.links)
        return np.concatenate(
            [
                np.arange(c.scale_gyr.start),
                np.arange(c.axis_far.start, c.delay.start),
                c.count + np.arange(HANDS),
            ]
        )

    def select(self, slopes: Array) -> Array:
        """Derivatives (..., P) by all of a finger's parameters, by those that are kept."""
        return np.concatenate([slopes, np.zeros((*slopes.shape[:-1], HANDS))], axis=-1)[
            ..., self.selected
        ]


@dataclass(frozen=True)
class AccumulatedInformation:
    """Information of stretches of movement, added up."""

    information: Array  # (P, P) on the parameters that are kept
    spurious_information: Array  # (P, P) of it by noise
    # (2,) of what accelerations at joints (m/s^2) and hinges (deg) are off, summed up
    squares: Array
    # (2,) of how many numbers these are the squares, less what the unknowns took up
    redundancy: Array
    seconds: float
    turned: float  # rad, of the last sensor, all its turning added up
    hand_turned: float  # rad, of the hand's
    bias_sd: float  # rad/s, of gyroscopes: less where every sensor rested

    @property
    def noise(self) -> Noise:
        """Sizes of errors estimated so far, as in `posterior.estimate_noise`."""
        sizes = np.sqrt(self.squares / np.maximum(self.redundancy, 1.0))
        acc, hinge = np.where(
            self.redundancy > 1,
            sizes / [np.linalg.norm(NUMEROV), 1.0],
            [Noise().acc, Noise().hinge],
        )
        return Noise(
            acc=max(float(acc), posterior.LEAST_ACC), hinge=max(float(hinge), posterior.LEAST_HINGE)
        )


@dataclass(frozen=True)
class JointObservability:
    """Observability of a joint against what self-calibration requires."""

    joint: str
    length_sd: float  # m, of the segments beside it, the larger; where none lies between two joints, of the joint's place
    excursion: float  # rad
    share: float  # 0 to 1: of what is enough, the least of all that is


def build_limb(
    finger: str, worn: Sequence[str], geometry: HandGeometry, mounting: Mapping[str, Array]
) -> Limb:
    """The prior of those segments with a sensor that are connected to the hand."""
    return Limb(
        build_chain([s for s in ("hand", *CHAINS[finger]) if s in worn]), geometry, mounting
    )


def no_information(of: Limb) -> AccumulatedInformation:
    """Zero information, before any movement."""
    none = np.zeros((len(of.selected), len(of.selected)))
    return AccumulatedInformation(none, none, np.zeros(2), np.zeros(2), 0.0, 0.0, 0.0, np.inf)


def accumulate(of: Limb, read: Readings, q_GS: Array, noise: Noise) -> AccumulatedInformation:
    """Information of a stretch with errors of these sizes; q_GS (S, 4) are the sensors' orientations at its first sample."""
    problem, at = _nominal_limb(of, read, q_GS, noise)
    n, selected = len(problem), of.selected
    normal = normal_equations.empty(
        n, 3 * len(of.links.sensors), parameter_columns(of.links).count + HANDS
    )
    terms = {kind: kind(problem, at, 0, n) for kind in residuals.EVERY_SAMPLE}
    terms[residuals.joint_acceleration_terms] = _add_hand_soft_tissue(
        problem, at, terms[residuals.joint_acceleration_terms]
    )
    for each in terms.values():
        normal_equations.add_terms(normal, each)
    normal = replace(
        normal,
        B=normal.B[:, :, selected],
        C=normal.C[np.ix_(selected, selected)],
        c=normal.c[selected],
    )
    L, Y, information = normal_equations.eliminate_trajectory(normal)
    r, slopes = _prior_rows(of, problem, at)
    alone = Factor(L, Y, normal_equations.invert(information + slopes.T @ slopes))
    step = _expand_step(
        of, normal_equations.solve_step(replace(normal, c=normal.c + slopes.T @ r), alone)
    )
    numbers = posterior.normal_numbers(n * L.shape[2] + len(selected), 0)
    drawn = _expand_step(
        of,
        normal_equations.draw_step(
            alone, numbers[: n * L.shape[2]].reshape(n, -1), numbers[n * L.shape[2] :]
        ),
    )
    off = [
        _residual_sum(terms[residuals.joint_acceleration_terms], step, drawn, noise.acc, 0),
        _residual_sum(terms[residuals.hinge_terms], step, drawn, noise.hinge, len(of.links.hinges)),
    ]
    squares, redundancy = np.array(off).T
    made_up = parameter_covariance.spurious_information(
        problem, at, alone, 1, [terms[residuals.joint_acceleration_terms]]
    )
    hand_turned, turned = (
        float(np.linalg.norm(problem.turns[:, s], axis=1).sum()) for s in (0, -1)
    )
    return AccumulatedInformation(
        information,
        made_up,
        squares,
        redundancy,
        n * problem.dt,
        turned,
        hand_turned,
        problem.bias_sd,
    )


def add_information(a: AccumulatedInformation, b: AccumulatedInformation) -> AccumulatedInformation:
    """Information of two stretches."""
    return AccumulatedInformation(
        a.information + b.information,
        a.spurious_information + b.spurious_information,
        a.squares + b.squares,
        a.redundancy + b.redundancy,
        a.seconds + b.seconds,
        a.turned + b.turned,
        a.hand_turned + b.hand_turned,
        min(a.bias_sd, b.bias_sd),
    )


def repeat(a: AccumulatedInformation, times: float) -> AccumulatedInformation:
    """The information multiplied by a number, as of so many equal stretches."""
    summed = ("information", "spurious_information", "squares", "redundancy")
    lasted = ("seconds", "turned", "hand_turned")
    return replace(a, **{name: times * getattr(a, name) for name in (*summed, *lasted)})


def assess_joints(
    asked: Requirements, of: Limb, so_far: AccumulatedInformation, flexion: Mapping[str, Array]
) -> list[JointObservability]:
    """By joint, from the information so far and the flexion (n,) rad by joint, NaN where unknown."""
    covariance, problem, at = _parameter_covariance(of, so_far)
    lengths = {
        s: float(np.sqrt(slope @ covariance @ slope))
        for s, slope in _length_gradients(of, problem, at).items()
    }
    turning = min(so_far.turned / asked.moving, so_far.hand_turned / asked.hand_moving) / max(
        np.radians(so_far.seconds), 1e-9
    )
    most = min(1.0, turning, (so_far.seconds + ROUNDED) / asked.shortest)
    return [
        _assess_joint(asked, of, k, at, covariance, lengths, most, flexion[joint])
        for k, joint in enumerate(of.links.joints)
    ]


def flexion_excursion(flexion: Array) -> float:
    """Of a joint's flexion (n,) rad, NaN where unknown; rad."""
    followed = flexion[np.isfinite(flexion)]
    return float(np.ptp(np.percentile(followed, SPREAD))) if len(followed) else 0.0


def _expand_step(of: Limb, step: Step) -> Step:
    """The step with zeros for the parameters that are not selected."""
    parameters = np.zeros(parameter_columns(of.links).count + HANDS)
    parameters[of.selected] = step.parameters
    return Step(step.turns, parameters)


def _add_hand_soft_tissue(problem: Problem, at: Unknowns, terms: Terms) -> Terms:
    """`joint_acceleration_terms` with further columns for the skin that moves the hand's sensor with this finger; the prior is a rigid one."""
    k, T, first = whole_hand_problem.root_joint(problem.chain), len(terms.r), terms.first + 1
    rigid = HandPlace(
        (at,), np.zeros((len(problem), 3)), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1)
    )
    samples = first + np.arange(T)[:, None] + np.arange(-1, 2)
    by_skin = hand_residuals.tissue_acceleration(problem, at, rigid, problem.bent[:, [k]], samples)[
        2
    ][..., :HANDS]
    seen = residuals.whitening_matrix(problem, first, first + T)[:, :, k] / residuals.common_scale(
        at
    )
    slopes = np.einsum("tj,tip->tjip", seen, by_skin).reshape(T, -1, HANDS)
    cols = np.concatenate([terms.cols, parameter_columns(problem.chain).count + np.arange(HANDS)])
    return replace(
        terms, by_parameters=np.concatenate([terms.by_parameters, slopes], axis=2), cols=cols
    )


def _prior_rows(of: Limb, problem: Problem, at: Unknowns) -> tuple[Array, Array]:
    """Residuals of the prior on the parameters that are kept and on the hand's skin, with their derivatives."""
    r, slopes = residuals.prior_residuals(problem, at)
    sizes = [np.radians(problem.noise.skin_turn), 1e-3 * problem.noise.skin_slide]
    sd = max(of.hand_skin, RIGID) * np.repeat(sizes, HANDS // 2) / (np.pi / 2)
    on_skin = np.pad(np.diag(1 / sd), ((0, 0), (len(of.selected) - HANDS, 0)))
    return np.append(r, np.zeros(HANDS)), np.concatenate([of.select(slopes), on_skin])


def _residual_sum(
    terms: Terms, step: Step, drawn: Step, sd: float, idle: int
) -> tuple[float, float]:
    """Sum of squares of the residuals after a step, in the unit of `sd`, and their degrees of freedom, of which those of the unknowns are found by a draw; `idle` rows of a sample are always 0."""
    left = terms.r + posterior.residual_change(terms, step)
    redundancy = (
        left.size - idle * len(left) - float((posterior.residual_change(terms, drawn) ** 2).sum())
    )
    return sd**2 * float((left**2).sum()), redundancy


def _assess_joint(
    asked: Requirements,
    of: Limb,
    k: int,
    at: Unknowns,
    covariance: Array,
    lengths: Mapping[int, float],
    most: float,
    flexion: Array,
) -> JointObservability:
    ends = int(of.links.parents[k]), int(of.links.children[k])
    excursion = flexion_excursion(flexion)
    beside = {s: lengths[s] for s in ends if s in lengths}
    good = [
        asked.length_known * of.geometry.lengths[of.links.sensors[s]] / sd
        for s, sd in beside.items()
    ]
    c = parameter_columns(of.links)
    place = max(
        _place_sd(covariance, arms.start + 3 * k, arm)
        for arms, arm in ((c.far, at.far[k]), (c.near, at.near[k]))
    )
    share = min(
        most, excursion / (SAFE * np.radians(asked.bent)), 1e-3 * asked.place_known / place, *good
    )
    return JointObservability(
        of.links.joints[k], max(beside.values(), default=place), excursion, float(share)
    )


def _place_sd(covariance: Array, row: int, arm: Array) -> float:
    """Standard deviation of a joint's place from its sensor, m: that of the arm, and that of the mounting's rotation."""
    arm_sd = float(np.sqrt(np.trace(covariance[row : row + 3, row : row + 3])))
    return float(np.hypot(arm_sd, np.radians(Noise().mounting) * np.linalg.norm(arm)))


def _parameter_covariance(
    of: Limb, so_far: AccumulatedInformation
) -> tuple[Array, Problem, Unknowns]:
    """Covariance (P, P) of the kept parameters, and the place where it was asked for."""
    S = len(of.links.sensors)
    none = Readings(
        0.01, np.zeros((2, S, 3)), np.zeros((2, S, 3)), np.ones((2, S)), np.ones((2, S))
    )
    problem, at = _nominal_limb(of, none, np.tile(quat.IDENTITY, (S, 1)), Noise())
    problem = replace(problem, bias_sd=min(so_far.bias_sd, np.radians(problem.noise.gyr_bias)))
    slopes = _prior_rows(of, problem, at)[1]
    before, arms = slopes.T @ slopes, of.select(parameter_covariance.arm_directions(problem, at))
    return (
        parameter_covariance.without_noise(
            normal_equations.invert(so_far.information + before),
            so_far.spurious_information,
            before,
            arms,
        ),
        problem,
        at,
    )


def _nominal_limb(of: Limb, read: Readings, q_GS: Array, noise: Noise) -> tuple[Problem, Unknowns]:
    """The finger of nominal size with sensors in the middle of their segments, that turns as its gyroscopes say."""
    links, geometry = of.links, of.geometry
    problem = with_lengths(
        build_problem(links, noise, read, q_GS, geometry.hand, of.mounting), geometry.lengths
    )
    half = 0.5 * np.array([geometry.lengths[s] for s in links.sensors])[:, None] * problem.distal
    far = half[links.parents]
    for k in np.flatnonzero(links.parents == 0):
        on_hand = np.subtract(
            geometry.joint_positions[links.joints[k]],
            0.5 * np.array(geometry.joint_positions["middle_mcp"]),
        )
        far[k] = quat.rotate(
            quat.conjugate(np.asarray(of.mounting.get("hand", quat.IDENTITY))), on_hand
        )
    S, J = len(links.sensors), len(links.joints)
    none, skin, whole = np.zeros((S, 3)), np.zeros((J, 3)), np.zeros((S, 3, 3))
    axes = (
        problem.flexing[links.parents[links.hinges]],
        problem.flexing[links.children[links.hinges]],
    )
    turned = _integrate_turns(q_GS, problem.turns)
    at = Unknowns(
        turned,
        far,
        -half[links.children],
        none,
        none,
        whole,
        whole,
        *axes,
        skin,
        skin,
        np.zeros(1),
        np.zeros((J, 2)),
        np.zeros(J),
    )
    return with_flexion(problem, at), at


def _integrate_turns(q_GS: Array, turns: Array) -> Array:
    """Orientations (n, S, 4) from the first (S, 4) and the turns between (n-1, S, 3)."""
    orientations = np.concatenate([q_GS[None], quat.exp(turns)])
    behind = 1
    while behind < len(orientations):  # products of twice as many each time
        orientations[behind:] = quat.multiply(orientations[:-behind], orientations[behind:])
        behind *= 2
    return quat.normalize(orientations)


def _length_gradients(of: Limb, problem: Problem, at: Unknowns) -> dict[int, Array]:
    """How each length changes with the kept parameters (P,), by row of its sensor."""
    lengths = residuals.length_priors(replace(problem, length=np.ones(len(of.links.sensors))), at)
    return {prior.sensor: of.select(prior.by_parameters[0]) for prior in lengths}
