"""Which contacts happened is decided by all of them together."""

import numpy as np
import pytest

from handscope.estimators.data.contact_constraint import Constraint
from handscope.estimators.methods.contact_hypotheses import (
    Hypothesis,
    decide,
    extend,
    first_hypothesis,
)
from handscope.estimators.numerics.typing import Array

SD, NOISE = 0.012, 0.003  # m, of the two unknowns, of each measurement
PRIOR = SD**2 * np.eye(2)


def measured(by_unknowns: Array, value: float) -> "Contact":
    return Contact(np.atleast_2d(by_unknowns), np.atleast_1d(value))


class Contact:
    """Places (1) on a line of which the distance depends on the unknowns and was to be zero."""

    def __init__(self, H: Array, value: Array) -> None:
        self.H, self.value = H, value

    def __call__(self, h: Hypothesis) -> tuple[Constraint, Array]:
        residual = self.H @ h.errors - self.value
        along = np.zeros((2, 1, 3))
        along[:, 0, 0] = 1.0, -1.0
        noise = NOISE**2 * np.eye(1)
        return Constraint(
            residual, along, np.zeros((2, 1, 3)), noise, float(abs(residual[0]))
        ), self.H


def combined(*contacts: Contact) -> list[Hypothesis]:
    found = first_hypothesis(np.zeros(2), PRIOR)
    for contact in contacts:
        found = extend(found, contact)
    return found


def least_squares(*contacts: Contact) -> tuple[Array, Array]:
    H = np.vstack([c.H for c in contacts])
    information = np.linalg.inv(PRIOR) + H.T @ H / NOISE**2
    P = np.linalg.inv(information)
    return P @ H.T @ np.concatenate([c.value for c in contacts]) / NOISE**2, P


AGREEING = (
    measured([1.0, 0.0], 0.010),
    measured([1.0, 1.0], 0.004),
    measured([1.0, -1.0], 0.016),
    measured([0.0, 1.0], -0.006),
)


def test_contacts_that_agree_are_all_believed_and_give_least_squares() -> None:
    best = decide(combined(*AGREEING))
    errors, P = least_squares(*AGREEING)
    assert all(a.happened for a in best.answers)
    np.testing.assert_allclose(best.errors, errors, atol=0.1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(best.P)), np.sqrt(np.diag(P)), rtol=0.2)


@pytest.mark.parametrize("place", range(4))
def test_a_contact_that_fits_the_prior_but_not_the_others_pulls_nothing(place: int) -> None:
    false = measured([1.0, 0.0], -0.020)
    assert decide(combined(false)).answers[0].happened
    contacts = list(AGREEING[:3])
    contacts.insert(place, false)
    best = decide(combined(*contacts))
    assert [a.happened for a in best.answers] == [k != place for k in range(4)]
    np.testing.assert_allclose(best.errors, least_squares(*AGREEING[:3])[0], atol=0.5e-3)


def test_where_it_is_open_whether_a_contact_happened_the_covariance_holds_both() -> None:
    contacts = combined(measured([1.0, 0.0], 0.035))
    best, sure = decide(contacts), least_squares(measured([1.0, 0.0], 0.035))[1]
    assert len(contacts) == 2
    apart = abs(contacts[0].errors[0] - contacts[1].errors[0])
    assert np.sqrt(best.P[0, 0]) > max(2 * np.sqrt(sure[0, 0]), 0.3 * apart)


def test_where_none_happened_those_after_are_believed_less() -> None:
    """The share of contacts that do not happen is learnt from the others."""
    wrong = [measured([0.0, 0.0], 0.05) for _ in range(6)]
    doubtful = measured([1.0, 0.0], 0.022)
    assert decide(combined(doubtful)).answers[-1].happened
    assert not decide(combined(*wrong, doubtful)).answers[-1].happened


def test_one_fingertip_above_the_table_is_left_out_and_the_others_are_used() -> None:
    levels = np.linalg.qr(np.column_stack([np.ones(5), np.eye(5)[:, 1:]]))[0][:, 1:].T  # (4, 5)
    by_places = np.zeros((5, 4, 3))
    by_places[:, :, 2] = levels.T
    heights = np.array([0.0, 0.0, 0.04, 0.0, 0.0])
    H = levels @ np.outer([1.0, 0.5, 0.0, -0.5, -1.0], [1.0, 0.0])

    def on_table(h: Hypothesis) -> tuple[Constraint, Array]:
        residual = levels @ heights + H @ (h.errors - [0.008, 0.0])
        return Constraint(residual, by_places, 0 * by_places, 0.002**2 * np.eye(4), 0.04), H

    best = decide(extend(first_hypothesis(np.zeros(2), PRIOR), on_table))
    assert best.answers[0].happened and best.answers[0].away == (2,)
    assert abs(best.errors[0] - 0.008) < 0.001
