"""The whole hand as one problem: limbs (fingers, the forearm) that have the hand's sensor in common.

In      Problems and places of limbs, each with the hand's sensor as its root
Out     HandProblem, HandPlace, the layout of their increments; the start from limbs that were solved alone
Source  Kortier, thesis ch. 4, for one finger. The noise of the hand's accelerometer, which all joints on the hand see at once, is an unknown of each sample:
        given it and the hand's orientation, limbs are independent
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration.problem import (
    Chain,
    Noise,
    Problem,
    Unknowns,
    apply_increment,
    flexion_at,
    parameter_columns,
    with_flexion,
)
from handscope.estimators.self_calibration.residuals import NUMEROV
from handscope.estimators.self_calibration.soft_tissue import tissue_response

TURN_AND_SLIDE = 6  # numbers of each joint on the hand
OWN = 3  # unknowns of a sample beside turns: the error of the hand's accelerometer


@dataclass(frozen=True)
class HandProblem:
    """Limbs that share the hand's sensor."""

    limbs: tuple[Problem, ...]  # over the same samples; what they share is counted in the first
    acc_sd: Array  # (n,) m/s^2, of the hand's accelerometer
    noise: Noise  # prior sizes of the errors

    def __len__(self) -> int:
        return len(self.limbs[0])


@dataclass(frozen=True)
class HandPlace:
    """Unknowns of the whole hand at one point of the iteration."""

    # the hand's orientations and errors and the delay are the same in all
    limbs: tuple[Unknowns, ...]
    error: Array  # (n, 3) m/s^2, of the hand's accelerometer as joints see it, in the global frame
    skin_turn: Array  # (F, 3) rad/rad, how far the hand's sensor turns with each limb's joint on the hand, in its frame
    skin_slide: Array  # (F, 3) m/rad, how far it slides
    skin_law: Array  # (F,) as `Unknowns.law` of that joint's own skin


@dataclass(frozen=True)
class Layout:
    """Where each limb's unknowns stand in those of the whole hand."""

    each: int  # unknowns of a sample: limb by limb, then the hand's turn and its accelerometer's error
    count: int  # parameters: those in common, of the hand's skin, then limb by limb
    sample: tuple[Indices, ...]  # of the turns of a limb's sensors and of the hand's error
    parameters: tuple[Indices, ...]  # of a limb's columns, and of the hand's skin
    skin: slice  # turns, slides, laws

    @property
    def error(self) -> slice:
        return slice(self.each - OWN, self.each)


def layout(problem: HandProblem) -> Layout:
    """Places of each limb's unknowns among those of the hand."""
    own_before, shared = 0, len(shared_columns(problem.limbs[0].chain))
    skin = slice(shared, shared + (TURN_AND_SLIDE + 1) * len(problem.limbs))
    each = sum(3 * (len(limb.chain.sensors) - 1) for limb in problem.limbs) + 3 + OWN
    sample, parameters, count = [], [], skin.stop
    for limb in problem.limbs:
        own = 3 * (len(limb.chain.sensors) - 1)
        sample.append(
            np.concatenate(
                [
                    np.arange(each - 3 - OWN, each - OWN),
                    own_before + np.arange(own),
                    np.arange(each - OWN, each),
                ]
            )
        )
        own_before += own
        where, together = (
            np.empty(parameter_columns(limb.chain).count, np.intp),
            shared_columns(limb.chain),
        )
        alone = np.setdiff1d(np.arange(len(where)), together)
        where[together], where[alone] = np.arange(shared), count + np.arange(len(alone))
        count += len(alone)
        parameters.append(np.concatenate([where, np.arange(skin.start, skin.stop)]))
    return Layout(each, count, tuple(sample), tuple(parameters), skin)


def shared_columns(chain: Chain) -> Indices:
    """Columns of a limb's parameters that are the hand's: errors of its sensor, and the delay."""
    c = parameter_columns(chain)
    sizes = ((c.bias_gyr, 3), (c.bias_acc, 3), (c.scale_gyr, 9), (c.scale_acc, 9), (c.delay, 1))
    return np.concatenate([where.start + np.arange(size) for where, size in sizes])


def gather_limbs(limbs: Sequence[Problem], noise: Noise) -> HandProblem:
    """One problem of limbs that were solved alone; the noise of the hand's accelerometer is the mean of their estimates."""
    return HandProblem(
        tuple(limbs), np.sqrt(np.mean([limb.acc_sd[:, 0] ** 2 for limb in limbs], axis=0)), noise
    )


def merge_places(places: Sequence[Unknowns]) -> HandPlace:
    """The start: the mean of the limbs' estimates of the hand's movement and errors; limbs keep their movement relative to the hand."""
    first = places[0].q_GS[:, 0]
    off = np.mean([quat.log(quat.relative(first, at.q_GS[:, 0])) for at in places], axis=0)
    hand = quat.normalize(quat.multiply(first, quat.exp(off)))
    carried, F = tuple(_carry_over(at, hand, places) for at in places), len(places)
    return HandPlace(
        carried, np.zeros((len(first), 3)), np.zeros((F, 3)), np.zeros((F, 3)), np.zeros(F)
    )


def _carry_over(at: Unknowns, hand: Array, places: Sequence[Unknowns]) -> Unknowns:
    onto = quat.multiply(hand, quat.conjugate(at.q_GS[:, 0]))
    found = replace(
        at,
        q_GS=quat.normalize(quat.multiply(onto[:, None], at.q_GS)),
        delay=np.mean([p.delay for p in places], axis=0),
    )
    for name in ("bias_gyr", "bias_acc", "scale_gyr", "scale_acc"):
        values = getattr(at, name).copy()
        values[0] = np.mean([getattr(p, name)[0] for p in places], axis=0)
        found = replace(found, **{name: values})
    return found


def apply_hand_increment(
    at: HandPlace, problem: HandProblem, samples: Array, parameters: Array
) -> HandPlace:
    """The unknowns after an increment: (n, each) of the samples, (count,) of the parameters."""
    where = layout(problem)
    limbs = tuple(
        apply_increment(
            place,
            limb.chain,
            samples[:, rows[:-OWN]].reshape(len(samples), -1, 3),
            parameters[cols[: parameter_columns(limb.chain).count]],
        )
        for place, limb, rows, cols in zip(at.limbs, problem.limbs, where.sample, where.parameters)
    )
    of_skin, moving = parameters[where.skin], TURN_AND_SLIDE * len(limbs)
    turn, slide = of_skin[:moving].reshape(2, -1, 3)
    law = at.skin_law + of_skin[moving:]
    return HandPlace(
        limbs, at.error + samples[:, where.error], at.skin_turn + turn, at.skin_slide + slide, law
    )


def at_samples(
    problem: HandProblem, at: HandPlace, samples: Indices
) -> tuple[HandProblem, HandPlace]:
    """Joints and place of some samples; the readings stay those of all."""
    limbs = tuple(flexion_at(limb, samples) for limb in problem.limbs)
    places = tuple(replace(place, q_GS=place.q_GS[samples]) for place in at.limbs)
    return replace(problem, limbs=limbs), replace(at, limbs=places, error=at.error[samples])


def root_joint(chain: Chain) -> int:
    """The joint with which a limb hangs on the hand."""
    return int(np.flatnonzero(chain.parents == 0)[0])


def root_flexion(problem: HandProblem) -> Array:
    """Flexion (n, F) rad of the joints on the hand."""
    return np.stack([limb.bent[:, root_joint(limb.chain)] for limb in problem.limbs], axis=1)


def remove_hand_tissue(problem: HandProblem, at: HandPlace) -> tuple[Unknowns, ...]:
    """Limbs on a hand whose skin does not turn the sensor."""
    back = quat.exp(-tissue_response(root_flexion(problem), at.skin_law) @ at.skin_turn)
    return tuple(
        replace(
            limb,
            q_GS=np.concatenate(
                [quat.multiply(limb.q_GS[:, :1], back[:, None]), limb.q_GS[:, 1:]], axis=1
            ),
        )
        for limb in at.limbs
    )


def with_hand_flexion(problem: HandProblem, at: HandPlace) -> HandProblem:
    """The same problem with joints flexed as here."""
    return replace(
        problem,
        limbs=tuple(
            with_flexion(limb, place)
            for limb, place in zip(problem.limbs, remove_hand_tissue(problem, at))
        ),
    )


def error_sd(problem: HandProblem) -> Array:
    """Standard deviation (n,) of the hand's accelerometer as joints see it, a mean of three samples (`residuals.whitening_matrix`)."""
    v, share = problem.acc_sd**2, NUMEROV**2 / (NUMEROV**2).sum()
    seen = v.copy()
    seen[1:-1] = share[0] * v[:-2] + share[1] * v[1:-1] + share[2] * v[2:]
    return np.asarray(np.sqrt(seen))
