"""The fit of all sensors' mounting: derivatives, truth, honest standard deviations."""

import numpy as np
import pytest

from handscope.estimators.alignment import functional_calibration, mounting_fit
from handscope.estimators.hand.anatomy import JOINTS, Hand
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.alignment.functional import PERFECT, TURNED, done, errors_of, pieces, posed
from tests.schedule import swept
from tests.simulated import DEG


@pytest.mark.parametrize("hinge", [True, False])
def test_derivatives_of_what_a_joint_forbids(hinge: bool) -> None:
    rng = np.random.default_rng(0)
    w_p, w_c = rng.normal(size=(2, 6, 3))
    A_p, A_c = (quat.matrix(quat.exp(0.6 * rng.normal(size=(6, 3)))) for _ in range(2))
    start = np.array([0.2, -0.1])

    def at(small: np.ndarray) -> np.ndarray:
        c, p = (quat.matrix(quat.exp(small[k : k + 3])) for k in (0, 3))
        return mounting_fit.forbidden_rates(
            w_p @ p.T, w_c @ c.T, p @ A_p @ p.T, c @ A_c @ c.T, start + small[6:], hinge
        )[0]

    numeric = np.stack([(at(h) - at(-h)) / 2e-6 for h in 1e-6 * np.eye(8)], axis=-1)
    np.testing.assert_allclose(
        mounting_fit.forbidden_rates(w_p, w_c, A_p, A_c, start, hinge)[1], numeric, atol=1e-7
    )


@pytest.mark.parametrize("hand", ["left", "right"])
def test_without_any_carelessness_or_noise_the_mounting_is_found(hand: Hand) -> None:
    recording = done(hand, errors=TURNED, care=PERFECT)
    found = functional_calibration.combine(m2.Params(), pieces(recording), posed(recording), {})
    assert max(np.linalg.norm(e) for e in errors_of(recording, found).values()) < 0.25 * DEG


@pytest.mark.parametrize("people", swept([2, 4], kept=[2]))
def test_standard_deviations_are_honest(people: int) -> None:
    """Normalised error squared of sensors put on anyhow by careless people, about each axis, of all
    sensors together and of neighbours' flexions: what a posture misses is shared by the sensors of
    a finger."""
    squared, together, bends = [], [], []
    for seed, hand in ((3, "left"), (4, "right"), (5, "left"), (6, "right"))[:people]:
        recording = done(hand, seed)
        found = functional_calibration.combine(m2.Params(), pieces(recording), posed(recording), {})
        errors = errors_of(recording, found)
        squared += [(errors[s] / sd) ** 2 for s, sd in found.q_BS_sd.items()]
        determined, all_errors = (
            list(found.q_BS_sd),
            np.concatenate([errors[s] for s in found.q_BS_sd]),
        )
        together.append(
            all_errors @ np.linalg.solve(found.mounting_covariance(), all_errors) / len(all_errors)
        )
        for joint in JOINTS:
            child, parent = (3 * determined.index(s) + 2 for s in (joint.child, joint.parent))
            between = np.zeros(len(all_errors))
            between[child], between[parent] = 1.0, -1.0
            bends.append(
                (between @ all_errors) ** 2 / (between @ found.mounting_covariance() @ between)
            )
    mean = np.mean(squared, axis=0)
    assert (mean > 0.2).all()
    assert (mean < 1.5).all()
    assert 0.5 < np.mean(together) < 1.2
    assert 0.6 < np.mean(bends) < 1.4
