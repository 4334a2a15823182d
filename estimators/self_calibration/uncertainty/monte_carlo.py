"""Uncertainty of mountings, places and movement of one finger, or of the forearm, by Monte-Carlo draws from the posterior.

In      a Solution of one finger, DRAWS places as probable as it (of the finger alone, or of the whole hand)
Out     Uncertainty: errors of mountings, places, angles and tip of each draw, with their standard deviations
Source  draws from the Gauss-Newton covariance (posterior.py); the unobservable part of a mounting is as uncertain as nominal mountings are, and
        so is at what angle of a joint skin is not pulled
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, SEGMENT, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import residuals, segments
from handscope.estimators.self_calibration.problem import Chain, Unknowns, flexion_at
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty import posterior

DRAWS = 24  # a standard deviation of so many is known within 15 %
EVERY = 10  # samples from one standard deviation of an angle to the next: they change slowly
SEATED = 1 << 15  # where the numbers for the mountings' draws begin


@dataclass(frozen=True)
class Uncertainty:
    """Errors of the draws against what was found, and standard deviations."""

    q_BS_errors: Mapping[str, Array]  # (DRAWS, 3) rad about the segment's axes
    p_BS: Mapping[str, Array]  # (3,) m, standard deviations
    rows: Indices  # (m,) samples of the stretch to which the next belong
    angle_errors: Array  # (DRAWS, m, joints, 3) rad; NaN where it is no joint of this finger
    tip_errors: Array  # (DRAWS, m, 3) m; NaN of the forearm

    @cached_property
    def q_BS(self) -> Mapping[str, Array]:
        """Standard deviations (3,) rad."""
        return {s: _root_mean_square(errors) for s, errors in self.q_BS_errors.items()}

    @cached_property
    def angles(self) -> Array:
        """Standard deviations (m, joints, 3) rad."""
        return _root_mean_square(self.angle_errors)

    @cached_property
    def tip(self) -> Array:
        """Standard deviations (m, 3) m."""
        return _root_mean_square(self.tip_errors)


def estimate_uncertainty(
    solution: Solution,
    draws: Iterable[Unknowns],
    hand: Hand,
    mounting: Mapping[str, Array],
    mounting_sd: float,
    sized: Callable[[Segments, float], HandGeometry],
) -> Uncertainty:
    """Standard deviations from draws, their orientations of `kept_samples`; `mounting_sd` rad; `sized` makes a hand of segments and of a standard normal number, the error of lengths that no movement determines."""
    rows = kept_samples(len(solution.problem))
    best = _subsample(solution, rows)
    solved = segments.of_solution(best, hand, mounting)
    others = list(_draw_segments(best, draws, hand, mounting, mounting_sd))
    angles, tip = _angles_and_tip(solved, sized(solved, 0.0))
    outputs = [
        _angles_and_tip(other, sized(other, luck)) for other, luck in zip(others, length_numbers())
    ]
    return Uncertainty(
        {
            s: np.array([quat.log(quat.multiply(o.q_BS[s], quat.conjugate(q))) for o in others])
            for s, q in solved.q_BS.items()
        },
        {s: _root_mean_square([o.p_BS[s] - p for o in others]) for s, p in solved.p_BS.items()},
        rows,
        np.array([a - angles for a, _ in outputs]),
        np.array([t - tip for _, t in outputs]),
    )


def kept_samples(count: int) -> Indices:
    """Of so many samples those that get a standard deviation (m,)."""
    return np.unique(np.append(np.arange(0, count, EVERY), count - 1))


def mounting_numbers() -> Array:
    """Errors of the draws' nominal mountings (DRAWS, segments, 3) about the segments' axes, in standard deviations: the same for all fingers."""
    numbers = [posterior.normal_numbers(3 * len(SEGMENTS), SEATED + k) for k in range(DRAWS)]
    return np.array(numbers).reshape(DRAWS, len(SEGMENTS), 3)


def length_numbers() -> Array:
    """Errors of the draws' lengths that no movement determines (DRAWS,), in standard deviations."""
    return posterior.normal_numbers(DRAWS, SEATED - 1)


def _draw_segments(
    best: Solution,
    draws: Iterable[Unknowns],
    hand: Hand,
    mounting: Mapping[str, Array],
    mounting_sd: float,
) -> Sequence[Segments]:
    others = []
    for at, turns in zip(draws, mounting_sd * mounting_numbers()):
        seated = {
            s: quat.multiply(quat.exp(turn), np.asarray(mounting.get(s, quat.IDENTITY), float))
            for s, turn in zip(SEGMENTS, turns)
        }
        drawn = straighten(
            at,
            best.problem.chain,
            _flexion_offsets(best.problem.chain, turns),
        )
        others.append(segments.of_solution(replace(best, at=drawn), hand, seated))
    return others


def _flexion_offsets(chain: Chain, turns: Array) -> Array:
    """Errors (J,) rad of the flexion of joints where mountings are off by `turns` (segments, 3) rad: a segment without two joints points as its mounting says."""
    shown = {s for s, _, _ in residuals.bones(chain)}
    z = [0.0 if s in shown else turns[SEGMENT[name], 2] for s, name in enumerate(chain.sensors)]
    return np.array([z[child] - z[parent] for parent, child in zip(chain.parents, chain.children)])


def straighten(at: Unknowns, chain: Chain, off: Array) -> Unknowns:
    """The unknowns with skin that is unstrained where joints are estimated to be bent by `off` (J,) rad."""
    near, far, axis_near, axis_far, slide = (
        at.near.copy(),
        at.far.copy(),
        at.axis_near.copy(),
        at.axis_far.copy(),
        at.skin_slide.copy(),
    )
    for k, s in enumerate(chain.children):
        back, behind, hinges = quat.exp(-off[k] * at.skin_turn[k]), chain.parents == s, chain.hinges
        for arms, which in ((near, k), (far, behind)):
            arms[which] = quat.rotate(back, arms[which] - off[k] * at.skin_slide[k])
        for axes, own in ((axis_near, hinges == k), (axis_far, behind[hinges])):
            axes[own] = quat.rotate(back, axes[own])
        slide[k] = quat.rotate(back, slide[k])
    return replace(at, near=near, far=far, axis_near=axis_near, axis_far=axis_far, skin_slide=slide)


def _subsample(solution: Solution, rows: Indices) -> Solution:
    return replace(
        solution,
        at=replace(solution.at, q_GS=solution.at.q_GS[rows]),
        problem=flexion_at(solution.problem, rows),
    )


def _angles_and_tip(solved: Segments, geometry: HandGeometry) -> tuple[Array, Array]:
    """Angles (m, joints, 3) and the finger's tip (m, 3), free of limits; the forearm has none, NaN."""
    m = len(solved.q_GB["hand"])
    q_GS = np.full((m, len(SEGMENTS), 4), np.nan)
    for name, q in solved.q_GB.items():
        q_GS[:, SEGMENT[name]] = q
    angles = np.where(IS_DOF, joint_angles.of_segments(q_GS), 0.0)
    fingers = [k for k, f in enumerate(FINGERS) if CHAINS[f][0] in solved.q_GB]
    if not fingers:
        return angles, np.full((m, 3), np.nan)
    return angles, forward_kinematics.tips(joint_angles.compose(angles), geometry)[:, fingers[0]]


def _root_mean_square(off: Sequence[Array] | Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(off), axis=0)))
