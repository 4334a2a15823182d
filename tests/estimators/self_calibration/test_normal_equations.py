import numpy as np
import pytest

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import normal_equations
from handscope.estimators.self_calibration.normal_equations import Normal
from handscope.estimators.self_calibration.residuals import Terms

N, E, P = 9, 4, 3


@pytest.fixture(scope="module")
def problem() -> tuple[Normal, Array, Array]:
    """A linear problem with residuals over one, two and three samples; the same as one dense matrix and right-hand side."""
    rng = np.random.default_rng(0)
    normal, rows, values = normal_equations.empty(N, E, P), [], []
    for knots in (1, 2, 3):
        T = N - knots + 1
        J, K, r = (
            rng.normal(size=(T, 5, knots * E)),
            rng.normal(size=(T, 5, 2)),
            rng.normal(size=(T, 5)),
        )
        normal_equations.add_terms(normal, Terms(0, knots, r, J, K, np.array([0, 2])))
        for t in range(T):
            whole = np.zeros((5, N * E + P))
            whole[:, t * E : (t + knots) * E], whole[:, [N * E, N * E + 2]] = J[t], K[t]
            rows.append(whole)
            values.append(r[t])
    normal.C[1, 1] += 2.0  # a prior
    rows.append(np.sqrt(2.0) * np.eye(N * E + P)[N * E + 1 : N * E + 2])
    values.append(np.zeros(1))
    return normal, np.concatenate(rows), np.concatenate(values)


def test_the_step_is_that_of_a_dense_solver(problem: tuple[Normal, Array, Array]) -> None:
    normal, J, r = problem
    factor = normal_equations.factorise(normal)
    step = normal_equations.solve_step(normal, factor)
    dense = -np.linalg.lstsq(J, r)[0]
    np.testing.assert_allclose(
        np.concatenate([step.turns.ravel(), step.parameters]), dense, atol=1e-12
    )
    np.testing.assert_allclose(
        factor.covariance, np.linalg.inv(J.T @ J)[N * E :, N * E :], atol=1e-13
    )


def test_draws_have_the_equations_covariance(problem: tuple[Normal, Array, Array]) -> None:
    """A draw is linear in its numbers: unit numbers give the columns of a root of the covariance."""
    normal, J, _ = problem
    factor = normal_equations.factorise(normal)
    columns = []
    for one in np.eye(N * E + P):
        step = normal_equations.draw_step(factor, one[: N * E].reshape(N, E), one[N * E :])
        columns.append(np.concatenate([step.turns.ravel(), step.parameters]))
    root = np.array(columns).T
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(J.T @ J), atol=1e-13)


def test_groups_of_samples_pull_the_parameters_as_a_dense_solver_says(
    problem: tuple[Normal, Array, Array],
) -> None:
    """Groups of four samples, of which each touches the sample before it and the one behind it."""
    normal, J, _ = problem
    both, each = np.zeros((2, N, E)), 4
    apart = []
    for group in range(3):
        v = np.zeros((N, E))
        first = max(each * group - 1, 0)
        v[first : each * group + each + 1] = group + 1.0 + np.arange(E)
        both[group % 2] += v
        apart.append(v.ravel())
    information = J.T @ J
    A, B = information[: N * E, : N * E], information[: N * E, N * E :]
    found = normal_equations.project_groups(normal_equations.factorise(normal), both, each)
    np.testing.assert_allclose(found, np.array(apart) @ np.linalg.solve(A, B), atol=1e-11)


def test_what_nothing_tells_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        normal_equations.factorise(normal_equations.empty(3, 2, 1))
