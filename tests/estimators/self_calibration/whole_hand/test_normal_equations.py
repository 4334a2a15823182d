"""The whole hand's normal equations, against numerical derivatives and a dense solver."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration.problem import (
    Noise,
    Readings,
    Unknowns,
    build_chain,
    build_problem,
    with_lengths,
)
from handscope.estimators.self_calibration.whole_hand import normal_equations
from handscope.estimators.self_calibration.whole_hand import problem as whole_hand_problem
from handscope.estimators.self_calibration.whole_hand import residuals as hand_residuals
from handscope.estimators.self_calibration.whole_hand.problem import HandPlace, HandProblem

SAMPLES = 5
LIMBS = (("hand", "index_proximal", "index_middle"), ("hand", "forearm"))


def _somewhere() -> tuple[HandProblem, HandPlace]:
    """A hand without sense at a place without sense: derivatives must hold everywhere."""
    rng, limbs, places = np.random.default_rng(0), [], []
    of_hand = rng.normal(size=(SAMPLES, 2, 3))
    q_hand = quat.multiply(
        quat.normalize(rng.normal(size=4)), quat.exp(0.1 * rng.normal(size=(SAMPLES, 3)))
    )
    own, delay = (0.01 * rng.normal(size=(24,)), np.array([0.002]))
    for names in LIMBS:
        links = build_chain(names)
        S, J, H = len(links.sensors), len(links.joints), len(links.hinges)
        gyr, acc = rng.normal(size=(SAMPLES, S, 3)), 9 * rng.normal(size=(SAMPLES, S, 3))
        gyr[:, 0], acc[:, 0] = of_hand[:, 0], 9 * of_hand[:, 1]
        sure = rng.uniform(1, 2, (SAMPLES, S))
        q = quat.multiply(
            quat.normalize(rng.normal(size=(S, 4))),
            quat.exp(0.1 * rng.normal(size=(SAMPLES, S, 3))),
        )
        q[:, 0] = q_hand
        axes = rng.normal(size=(2, H, 3))
        axes /= np.linalg.norm(axes, axis=2, keepdims=True)
        errors = [0.01 * rng.normal(size=(S, size)) for size in (3, 3, 9, 9)]
        for values, of_root in zip(errors, np.split(own, [3, 6, 15])):
            values[0] = of_root
        at = Unknowns(
            q,
            *(0.03 * rng.normal(size=(2, J, 3))),
            *errors[:2],
            *(m.reshape(S, 3, 3) for m in errors[2:]),
            *axes,
            0.05 * rng.normal(size=(J, 3)),
            0.001 * rng.normal(size=(J, 3)),
            delay,
            0.1 * rng.normal(size=(J, 2)),
            0.3 * rng.normal(size=J),
        )
        problem = with_lengths(
            build_problem(links, Noise(), Readings(0.01, gyr, acc, sure, sure), q[0], "left", {}),
            {names[1]: 0.04},
        )
        limbs.append(
            replace(
                problem,
                bent=rng.normal(size=(SAMPLES, J)),
                by_tilt=rng.normal(size=(SAMPLES, J, 2)),
            )
        )
        places.append(at)
    skin = rng.normal(size=(2, 2, 3)) * np.array([0.05, 0.001])[:, None, None]
    return whole_hand_problem.gather_limbs(limbs, Noise()), HandPlace(
        tuple(places), rng.normal(size=(SAMPLES, 3)), *skin, skin_law=0.3 * rng.normal(size=2)
    )


@pytest.fixture(scope="module")
def somewhere() -> tuple[HandProblem, HandPlace]:
    return _somewhere()


def _whole(problem: HandProblem, at: HandPlace) -> Array:
    """All residuals in a row (m,)."""
    parts = [
        (at.error / whole_hand_problem.error_sd(problem)[:, None]).ravel(),
        hand_residuals.hand_tissue_priors(problem, at)[0],
    ]
    for k, (limb, place) in enumerate(zip(problem.limbs, at.limbs)):
        parts += [terms.r.ravel() for terms in hand_residuals.terms_of(problem, at, k)]
        parts.append(hand_residuals.limb_priors(limb, place, shares=k == 0)[0])
    return np.concatenate(parts)


def _slopes(problem: HandProblem, at: HandPlace) -> Array:
    """Their numerical derivatives (m, unknowns of all samples and parameters)."""
    where, found = whole_hand_problem.layout(problem), []
    n = SAMPLES * where.each
    for one in 1e-6 * np.eye(n + where.count):
        two = [
            _whole(
                problem,
                whole_hand_problem.apply_hand_increment(
                    at, problem, sign * one[:n].reshape(SAMPLES, -1), sign * one[n:]
                ),
            )
            for sign in (1.0, -1.0)
        ]
        found.append((two[0] - two[1]) / 2e-6)
    return np.array(found).T


@pytest.fixture(scope="module")
def dense(somewhere: tuple[HandProblem, HandPlace]) -> tuple[Array, Array]:
    return _whole(*somewhere), _slopes(*somewhere)


@pytest.mark.parametrize("together", [1, normal_equations.TOGETHER])
def test_the_step_and_the_covariance_are_those_of_a_dense_solver(
    somewhere: tuple[HandProblem, HandPlace],
    dense: tuple[Array, Array],
    together: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of numerical derivatives: a wrong derivative, a block in a wrong place, a shared row counted twice would all show; however many pairs go together."""
    monkeypatch.setattr(normal_equations, "TOGETHER", together)
    (problem, at), (r, J) = somewhere, dense
    normal = normal_equations.build_normal_equations(problem, at)
    factor = normal_equations.factorise(normal)
    step = normal_equations.solve_step(normal, factor)
    scale = np.sqrt((J**2).sum(axis=0))
    root = np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale)
    n, sd = SAMPLES * normal.layout.each, np.sqrt(np.diag(root))
    assert normal.cost == pytest.approx(0.5 * (r**2).sum(), rel=1e-12)
    np.testing.assert_allclose(
        np.concatenate([step.turns.ravel(), step.parameters]) / sd,
        -root @ (J.T @ r) / sd,
        atol=0.03,
    )
    np.testing.assert_allclose(
        factor.covariance / np.outer(sd[n:], sd[n:]),
        root[n:, n:] / np.outer(sd[n:], sd[n:]),
        atol=1e-4,
    )


def test_draws_have_the_equations_covariance(
    somewhere: tuple[HandProblem, HandPlace], dense: tuple[Array, Array]
) -> None:
    (problem, at), (_, J) = somewhere, dense
    normal = normal_equations.build_normal_equations(problem, at)
    factor = normal_equations.factorise(normal)
    each, n = normal.layout.each, SAMPLES * normal.layout.each
    numbers = np.eye(n + normal.layout.count)
    drawn = normal_equations.draw_steps(
        normal, factor, numbers[:, :n].reshape(-1, SAMPLES, each), numbers[:, n:]
    )
    root = np.array([np.concatenate([step.turns.ravel(), step.parameters]) for step in drawn]).T
    np.testing.assert_allclose(
        (J @ root).T @ (J @ root), np.eye(n + normal.layout.count), atol=1e-3
    )


@pytest.mark.parametrize("together", [1, 2, normal_equations.TOGETHER])
def test_groups_of_samples_pull_the_parameters_as_each_does_alone(
    somewhere: tuple[HandProblem, HandPlace], together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Groups of two samples, of which each touches the sample before it and the one behind it."""
    monkeypatch.setattr(normal_equations, "TOGETHER", together)
    normal = normal_equations.build_normal_equations(*somewhere)
    factor = normal_equations.factorise(normal)
    apart = np.zeros((3, SAMPLES, normal.layout.each))
    for group, v in enumerate(apart):
        near = slice(max(2 * group - 1, 0), 2 * group + 3)
        v[near] = np.random.default_rng(group).normal(size=v[near].shape)
    both = np.stack([apart[0] + apart[2], apart[1]])
    np.testing.assert_allclose(
        normal_equations.project_groups(normal, factor, both, 2),
        normal_equations.project_on_parameters(normal, factor, apart),
        rtol=1e-6,
    )


def test_derivatives_of_what_is_seen_on_the_hand(
    somewhere: tuple[HandProblem, HandPlace], dense: tuple[Array, Array]
) -> None:
    """The gradient, by every unknown."""
    (problem, at), (r, J) = somewhere, dense
    normal, gradient = normal_equations.build_normal_equations(problem, at), J.T @ r
    n = SAMPLES * normal.layout.each
    scale = np.sqrt((J**2).sum(axis=0)) * np.sqrt((r**2).sum())
    np.testing.assert_allclose(normal.c / scale[n:], gradient[n:] / scale[n:], atol=1e-8)


def test_one_limb_alone_is_the_problem_that_it_is_alone(
    somewhere: tuple[HandProblem, HandPlace],
) -> None:
    """The hand's error taken out by hand: its best size for given joints leaves the residuals of the joints whitened together."""
    problem, at = somewhere
    limb, place = problem.limbs[0], at.limbs[0]
    one = whole_hand_problem.gather_limbs([limb], Noise())
    still = HandPlace(
        (place,), np.zeros((SAMPLES, 3)), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1)
    )
    normal = normal_equations.build_normal_equations(one, still)
    where = normal.layout.error
    A = normal.limbs[0].A[:, 0][:, where, where] + np.eye(3) / normal.error_sd[:, None, None] ** 2
    a = normal.limbs[0].a[:, where]
    least = normal.cost - 0.5 * sum(v @ np.linalg.solve(M, v) for M, v in zip(A, a))
    together = 0.5 * sum(
        (kind(limb, place, 0, SAMPLES).r ** 2).sum() for kind in residuals.EVERY_SAMPLE
    )
    assert least == pytest.approx(
        together + 0.5 * (residuals.prior_residuals(limb, place)[0] ** 2).sum(), rel=1e-9
    )
