from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FLEXION, JOINT, SEGMENT, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration.problem import (
    Noise,
    Problem,
    Readings,
    Unknowns,
    apply_increment,
    build_chain,
    build_problem,
    integrate_rates,
    joint_flexion,
    parameter_columns,
    with_flexion,
    with_lengths,
)
from handscope.estimators.self_calibration.soft_tissue import right_jacobian
from handscope.estimators.self_calibration.uncertainty import posterior
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL
from tests.estimators.self_calibration.fingers import HINGED, readings

SAMPLES = 5
HUMAN = build_chain(
    ("hand", "index_proximal", "index_middle", "thumb_metacarpal", "thumb_proximal")
)


def _somewhere() -> tuple[Problem, Unknowns]:
    """A problem without sense and a place without sense: derivatives must hold everywhere."""
    rng, links = np.random.default_rng(0), HUMAN
    S, J, H = len(links.sensors), len(links.joints), len(links.hinges)
    sure = rng.uniform(1, 2, (SAMPLES, S))
    read = Readings(
        0.01, rng.normal(size=(SAMPLES, S, 3)), 9 * rng.normal(size=(SAMPLES, S, 3)), sure, sure
    )
    q = quat.normalize(rng.normal(size=(SAMPLES, S, 4)))
    q = quat.multiply(q[:1], quat.exp(0.1 * rng.normal(size=(SAMPLES, S, 3))))
    axes = rng.normal(size=(2, H, 3))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    arms, skin = 0.03 * rng.normal(size=(2, J, 3)), 0.05 * rng.normal(size=(2, J, 3))
    at = Unknowns(
        q,
        *arms,
        0.01 * rng.normal(size=(S, 3)),
        0.05 * rng.normal(size=(S, 3)),
        *(0.02 * rng.normal(size=(2, S, 3, 3))),
        *axes,
        skin[0],
        0.01 * skin[1],
        np.array([0.002]),
        0.1 * rng.normal(size=(J, 2)),
        0.3 * rng.normal(size=J),
    )
    problem = build_problem(links, Noise(), read, quat.normalize(q[0] + 0.1), "left", {})
    given = with_lengths(problem, {"index_proximal": 0.04, "index_middle": 0.02})
    return replace(
        given, bent=rng.normal(size=(SAMPLES, J)), by_tilt=rng.normal(size=(SAMPLES, J, 2))
    ), at


@pytest.mark.parametrize("kind", residuals.EVERY_SAMPLE, ids=lambda k: k.__name__)
@pytest.mark.parametrize("stretch", [(0, SAMPLES), (0, 3), (1, 4)])
def test_derivatives_of_a_residual(
    kind: Callable[..., residuals.Terms], stretch: tuple[int, int]
) -> None:
    problem, at = _somewhere()
    terms = kind(problem, at, *stretch)
    S, P = len(problem.chain.sensors), parameter_columns(problem.chain).count
    each, m = 3 * S, terms.r.shape[1]
    analytic_x, analytic_p = (
        np.zeros((len(terms.r), m, SAMPLES * each)),
        np.zeros((len(terms.r), m, P)),
    )
    for t in range(len(terms.r)):
        first = (terms.first + t) * each
        analytic_x[t, :, first : first + terms.knots * each] = terms.by_turns[t]
    analytic_p[:, :, terms.cols] = terms.by_parameters
    numeric = _derivative(
        lambda x: kind(problem, _changed(problem, at, x), *stretch).r,
        SAMPLES * each + P,
        _steps(problem),
    )
    scale = np.abs(numeric).max(initial=1.0)
    np.testing.assert_allclose(
        np.concatenate([analytic_x, analytic_p], axis=2), numeric, atol=2e-7 * scale
    )


def test_derivatives_of_the_priors() -> None:
    problem, at = _somewhere()
    _, analytic = residuals.prior_residuals(problem, at)
    P, n = parameter_columns(problem.chain).count, SAMPLES * 3 * len(problem.chain.sensors)
    numeric = _derivative(
        lambda p: residuals.prior_residuals(
            problem, _changed(problem, at, np.concatenate([np.zeros(n), p]))
        )[0],
        P,
    )
    np.testing.assert_allclose(analytic, numeric, atol=2e-7 * np.abs(numeric).max())


def test_bending_about_an_axis_that_is_tilted() -> None:
    """A tilt changes how far joints are counted as bent as it was said to, and that of hinges, whose axes are found, not at all."""
    problem, at = _somewhere()
    rigid = replace(at, skin_turn=0 * at.skin_turn)
    here, there = with_flexion(problem, rigid), replace(rigid, tilt=at.tilt + 1e-4)
    change = joint_flexion(here, there, np.arange(SAMPLES)) - here.bent
    np.testing.assert_allclose(change, with_flexion(problem, there).bent - here.bent, atol=1e-7)
    assert (np.abs(change) > 1e-5).any(axis=0).tolist() == [
        k not in problem.chain.hinges for k in range(len(problem.chain.joints))
    ]


def test_skin_of_another_law_leaves_nothing_either() -> None:
    """Skin that at 90 deg follows by half more than in proportion is that of a joint bent as much farther."""
    problem, at = _somewhere()
    lawful = replace(at, law=np.full(len(at.law), 0.5))
    farther = replace(problem, bent=joint_flexion(problem, at, np.arange(SAMPLES)), tilt=at.tilt)
    farther = replace(farther, bent=farther.bent * (1 + 0.5 * farther.bent / (np.pi / 2)))
    np.testing.assert_allclose(
        residuals.joint_acceleration_terms(problem, lawful, 0, SAMPLES).r,
        residuals.joint_acceleration_terms(farther, replace(at, law=0 * at.law), 0, SAMPLES).r,
        rtol=1e-9,
    )


def test_the_size_of_few_unknowns_is_the_most_likely_one() -> None:
    """Of unknowns that the readings tell by themselves: their mean square less its error; of those that are nothing, the least."""
    believed, sure = 0.5, 0.01
    covariance = np.eye(3) / (1 / sure**2 + 1 / believed**2)
    found = np.array([0.2, -0.3, 0.4])
    size = posterior.most_likely_spread(found, covariance, believed, 0.02)
    assert size == pytest.approx(np.sqrt(np.mean(found**2)), rel=0.01)
    assert posterior.most_likely_spread(0.001 * found, covariance, believed, 0.02) == 0.02


@pytest.mark.parametrize("size", [0.0, 1e-6, 1e-3, 0.3, 2.0])
def test_jacobians_of_rotation_vectors(size: float) -> None:
    v = size * np.array([0.6, -0.48, 0.64])
    numeric = _derivative(lambda d: quat.log(quat.relative(quat.exp(v), quat.exp(v + d))), 3)
    np.testing.assert_allclose(right_jacobian(v), numeric, atol=1e-8)
    np.testing.assert_allclose(
        residuals.inverse_jacobian(v) @ right_jacobian(v), np.eye(3), atol=1e-10
    )


def test_sensors_of_the_same_rate_turn_exactly() -> None:
    """About an axis that stands still, by cubic rates: the quadrature is exact."""
    t = np.arange(8.0)
    w = np.stack([0.1 * t**3 - t, 2 * (0.1 * t**3 - t), 0 * t], axis=1)[:, None]
    integral = 0.025 * t**4 - 0.5 * t**2
    expected = np.diff(integral)[:, None] * [1.0, 2.0, 0.0]
    np.testing.assert_allclose(integrate_rates(w, 1.0)[1:-1, 0], expected[1:-1], rtol=1e-12)


@pytest.mark.parametrize("skin", [False, True])
def test_the_truth_leaves_almost_nothing(skin: bool) -> None:
    """A finger without noise: what second differences do not describe is far below an accelerometer's noise (0.02 m/s^2); of skin nothing is left."""
    errors = replace(IDEAL, skin_angle=2.0, skin_shift=1.0) if skin else IDEAL
    recording = artificial_finger.record_trial(np.random.default_rng(0), errors, duration=10.0)
    read, at, bends = readings(recording), *_truth(recording)
    problem = replace(
        build_problem(HINGED, Noise(acc=1.0), read, at.q_GS[0], recording.hand, recording.mounting),
        bent=bends,
    )
    white = residuals.joint_acceleration_terms(problem, at, 0, len(problem)).r
    assert np.sqrt((white**2).mean()) < 5e-4  # m/s^2: the noise was said to be 1
    apart = np.radians(problem.noise.hinge) * residuals.hinge_terms(problem, at, 0, len(problem)).r
    assert np.degrees(np.abs(apart).max()) < 1e-6


def test_a_small_world_gains_nothing_from_a_lively_hand() -> None:
    """However fast it goes to and fro: gravity tells how large the accelerometers' world is."""
    problem, at = _somewhere()
    upright = replace(
        at, q_GS=np.broadcast_to(quat.IDENTITY, at.q_GS.shape), bias_acc=0 * at.bias_acc
    )
    read = np.array([0.0, 0.0, GRAVITY]) + 40.0 * np.array(
        [[1.0, -2, 1], [-2, 1, -1], [0, 0, 0], [2, 1, 1], [-1, 0, -1]]
    )
    lively = replace(problem, acc=np.repeat(read[:, None], len(problem.chain.sensors), axis=1))
    costs = [
        float(
            (
                residuals.mean_acceleration_terms(
                    lively,
                    replace(upright, scale_acc=np.broadcast_to(s * np.eye(3), at.scale_acc.shape)),
                    0,
                    SAMPLES,
                ).r
                ** 2
            ).sum()
        )
        for s in (-0.5, -0.001, 0.0, 0.001, 0.5)
    ]
    assert np.argmin(costs) == 2


def _truth(recording: Simulated) -> tuple[Unknowns, Array]:
    """What the simulation knows, as unknowns, and how far its joints are bent (n, J)."""
    worn, truth, hand = recording.sensors, recording.truth, recording.hand
    rows = [SEGMENT[s] for s in HINGED.sensors]
    angles = np.stack([truth.angles[:, JOINT[j], FLEXION] for j in HINGED.joints], axis=1)
    pulled = np.concatenate([np.zeros((len(angles), 1)), angles], axis=1)
    q_BS = quat.multiply(quat.exp(pulled[..., None] * worn.skin_turn), worn.q_BS)
    if not worn.skin_turn[0].any():
        q_BS[:, 0] = worn.q_BS[0]
    else:
        q_BS[:, 0] = quat.multiply(
            quat.exp(truth.angles[:, JOINT["middle_mcp"], FLEXION, None] * worn.skin_turn[0]),
            worn.q_BS[0],
        )
    geometry = artificial_finger.printed_geometry(hand)
    bone = side_sign(hand) * np.array([0.0, artificial_finger.HINGES, 0.0])
    knuckle = np.array(geometry.joint_positions["index_mcp"]) - np.array(
        geometry.joint_positions["middle_mcp"]
    )
    to_sensor = quat.conjugate(worn.q_BS)
    far = quat.rotate(to_sensor[:3], np.array([knuckle, np.zeros(3), np.zeros(3)]) - worn.p_BS[:3])
    near = quat.rotate(to_sensor[1:], -bone - worn.p_BS[1:])
    axes = quat.rotate(to_sensor, np.array([0.0, 0.0, 1.0]))
    turn, slide = (
        quat.rotate(to_sensor[1:], worn.skin_turn[1:]),
        quat.rotate(to_sensor[1:], worn.skin_slide[1:]),
    )
    q_GS = quat.multiply(truth.q_GS[:, rows], q_BS)
    return Unknowns(
        q_GS,
        far,
        near,
        np.zeros((4, 3)),
        np.zeros((4, 3)),
        *np.zeros((2, 4, 3, 3)),
        axes[:3],
        axes[1:],
        turn,
        slide,
        np.zeros(1),
        np.zeros((3, 2)),
        np.zeros(3),
    ), angles


def _changed(problem: Problem, at: Unknowns, x: Array) -> Unknowns:
    n = SAMPLES * 3 * len(problem.chain.sensors)
    return apply_increment(at, problem.chain, x[:n].reshape(SAMPLES, -1, 3), x[n:])


def _steps(problem: Problem) -> Array:
    return np.full(
        SAMPLES * 3 * len(problem.chain.sensors) + parameter_columns(problem.chain).count, 1e-6
    )


def _derivative(f: Callable[[Array], Array], n: int, steps: Array | None = None) -> Array:
    """Central differences (..., n)."""
    sizes = np.full(n, 1e-6) if steps is None else steps
    return np.stack([(f(d) - f(-d)) / (2 * h) for h, d in zip(sizes, np.diag(sizes))], axis=-1)
