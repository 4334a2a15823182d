"""The whole hand's normal equations, against numerical derivatives and a dense solver."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import normal_equations as residual_equations
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration.problem import (
    Noise,
    Readings,
    Unknowns,
    build_chain,
    build_problem,
    with_lengths,
)
from handscope.estimators.self_calibration.uncertainty import posterior
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


@pytest.mark.parametrize("piece", [2, 4, normal_equations.PIECE])
def test_the_step_and_the_covariance_are_those_of_a_dense_solver(
    somewhere: tuple[HandProblem, HandPlace],
    dense: tuple[Array, Array],
    piece: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of numerical derivatives: a wrong derivative, a block in a wrong place, a row counted twice would all show; however many samples go together."""
    monkeypatch.setattr(normal_equations, "PIECE", piece)
    (problem, at), (r, J) = somewhere, dense
    factor = normal_equations.factorise(problem, at)
    step = normal_equations.solve_step(factor)
    root, n = _covariance(J), SAMPLES * factor.layout.each
    sd = np.sqrt(np.diag(root))
    assert hand_residuals.cost(problem, at) == pytest.approx(0.5 * (r**2).sum(), rel=1e-12)
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


def _covariance(J: Array) -> Array:
    scale = np.sqrt((J**2).sum(axis=0))
    return np.asarray(np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale))


@pytest.mark.parametrize("piece", [2, normal_equations.PIECE])
def test_draws_have_the_equations_covariance(
    somewhere: tuple[HandProblem, HandPlace],
    dense: tuple[Array, Array],
    piece: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(normal_equations, "PIECE", piece)
    factor = normal_equations.factorise(*somewhere)
    n = SAMPLES * factor.layout.each
    numbers = np.eye(n + factor.layout.count)
    monkeypatch.setattr(
        posterior,
        "normal_numbers",
        lambda count, which, first=0: numbers[which, first : first + count],
    )
    drawn = normal_equations.draw_steps(factor, len(numbers), np.arange(SAMPLES))
    root = np.array([np.concatenate([step.turns.ravel(), step.parameters]) for step in drawn]).T
    J = dense[1]
    np.testing.assert_allclose((J @ root).T @ (J @ root), numbers, atol=1e-3)
    some = normal_equations.draw_steps(factor, 3, np.array([0, 3]))
    np.testing.assert_array_equal(some[2].turns, drawn[2].turns[[0, 3]])


@pytest.mark.parametrize("piece", [2, 4, normal_equations.PIECE])
def test_groups_of_samples_pull_the_parameters_as_a_dense_solver_says(
    somewhere: tuple[HandProblem, HandPlace],
    dense: tuple[Array, Array],
    piece: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Groups of two samples, of which each touches the sample before it and the one behind it."""
    monkeypatch.setattr(normal_equations, "PIECE", piece)
    factor, J = normal_equations.factorise(*somewhere), dense[1]
    apart = np.zeros((3, SAMPLES, factor.layout.each))
    for group, v in enumerate(apart):
        near = slice(max(2 * group - 1, 0), 2 * group + 3)
        v[near] = np.random.default_rng(group).normal(size=v[near].shape)
    both = np.stack([apart[0] + apart[2], apart[1]])
    n = SAMPLES * factor.layout.each
    flat, scale = apart.reshape(3, -1), np.sqrt((J[:, :n] ** 2).sum(axis=0))
    of_samples = np.linalg.solve((J[:, :n] / scale).T @ (J[:, :n] / scale), (flat / scale).T)
    expected = (J[:, n:].T @ (J[:, :n] / scale) @ of_samples).T
    np.testing.assert_allclose(
        normal_equations.project_groups(factor, both, 2) / np.abs(expected).max(),
        expected / np.abs(expected).max(),
        atol=1e-5,
    )


def test_derivatives_of_what_is_seen_on_the_hand(
    somewhere: tuple[HandProblem, HandPlace], dense: tuple[Array, Array]
) -> None:
    """The gradient, by every parameter while the trajectory stays."""
    (problem, at), (r, J) = somewhere, dense
    where = whole_hand_problem.layout(problem)
    n, found = SAMPLES * where.each, np.zeros(where.count)
    off, sd = hand_residuals.hand_tissue_priors(problem, at)
    found[where.skin] = off / sd
    for k, cols in enumerate(where.parameters):
        rows, slopes = hand_residuals.limb_priors(problem.limbs[k], at.limbs[k], shares=k == 0)
        found[cols[: slopes.shape[1]]] += slopes.T @ rows
        for terms in hand_residuals.terms_of(problem, at, k):
            found[cols[terms.cols]] += np.einsum("tmp,tm->p", terms.by_parameters, terms.r)
    scale = np.sqrt((J**2).sum(axis=0))[n:] * np.sqrt((r**2).sum())
    np.testing.assert_allclose(found / scale, (J.T @ r)[n:] / scale, atol=1e-8)


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
    A, a = np.zeros((SAMPLES, 3, 3)), np.zeros((SAMPLES, 3))
    sd = whole_hand_problem.error_sd(one)[:, None]
    A += np.eye(3) / sd[..., None] ** 2
    for terms in hand_residuals.terms_of(one, still, 0):
        if terms.knots == residual_equations.SPAN:  # joints see the error in their middle sample
            T = len(terms.r)
            by = terms.by_turns.reshape(T, -1, terms.knots, 3 * len(limb.chain.sensors) + 3)
            seen = by[:, :, 1, -3:]
            A[1 : T + 1] += np.einsum("tmi,tmj->tij", seen, seen)
            a[1 : T + 1] += np.einsum("tmi,tm->ti", seen, terms.r)
    least = hand_residuals.cost(one, still) - 0.5 * sum(
        v @ np.linalg.solve(M, v) for M, v in zip(A, a)
    )
    together = 0.5 * sum(
        (kind(limb, place, 0, SAMPLES).r ** 2).sum() for kind in residuals.EVERY_SAMPLE
    )
    assert least == pytest.approx(
        together + 0.5 * (residuals.prior_residuals(limb, place)[0] ** 2).sum(), rel=1e-9
    )
