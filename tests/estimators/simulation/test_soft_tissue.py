"""How skin follows a joint."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation import kinematics, sensors, soft_tissue
from handscope.estimators.simulation.distributions import DISTRIBUTIONS, draw
from handscope.estimators.simulation.motion import make_posture, move_through
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import DEG

STEP = 1e-3
T = np.arange(0.0, 4.0, STEP)
FLEXION = 60 * DEG * np.sin(2 * T)[:, None]


@pytest.mark.parametrize("law", ["proportional", "quadratic", "delayed"])
def test_derivatives_of_a_law_are_its_own(law: str) -> None:
    flexion = FLEXION, 120 * DEG * np.cos(2 * T)[:, None], -4 * FLEXION
    y, dy, ddy = soft_tissue.follow(law, T, flexion)
    smooth = np.abs(FLEXION[1:-1]) > 2 * DEG  # the square has a kink where the joint is straight
    np.testing.assert_allclose(np.gradient(y, STEP, axis=0)[1:-1], dy[1:-1], atol=5e-3)
    turned = np.gradient(dy, STEP, axis=0)[1:-1]
    np.testing.assert_allclose(turned[smooth][2:], ddy[1:-1][smooth][2:], atol=2e-2)


def test_every_law_gives_a_right_angle_at_a_right_angle() -> None:
    bent = np.clip(90 * DEG * T / 2, 0, 90 * DEG)[:, None]
    for law, missed in (("proportional", 0.0), ("quadratic", 0.0), ("delayed", 1e-4)):
        y = soft_tissue.follow(law, T, (bent, np.gradient(bent, STEP, axis=0), 0 * bent))[0]
        np.testing.assert_allclose(y[-1], 90 * DEG, atol=missed)


def test_skin_that_sticks_moves_only_after_the_joint_has_bent_back() -> None:
    y, dy, _ = soft_tissue.follow(
        "sticking", T, (FLEXION, np.gradient(FLEXION, STEP, axis=0), 0 * FLEXION)
    )
    assert np.abs(y - FLEXION).max() == pytest.approx(soft_tissue.PLAY)
    turn = int(np.argmax(FLEXION[:2000]))
    assert y[turn] == y[turn + 100]
    assert not dy[turn + 1 : turn + 100].any()


@pytest.mark.parametrize(
    "errors",
    [
        {"slip": 3.0},
        {"skin_law": "quadratic", "skin_angle": 20.0},
        {"skin_law": "delayed", "skin_angle": 20.0},
        {"skin_law": "sticking", "skin_angle": 20.0},
    ],
)
def test_a_gyroscope_reads_what_skin_and_slip_turn_its_sensor_by(errors: dict[str, float]) -> None:
    geometry = sized("left")
    bent = make_posture(task_performance.flat(), index_pip_flexion=70, index_mcp_flexion=50)
    motion = move_through([(0.0, task_performance.flat()), (1.0, bent), (2.0, bent)])
    k = kinematics.compute_kinematics(motion, geometry, np.arange(0.0, 2.0, STEP))
    worn = sensors.mount_sensors(
        SEGMENTS,
        geometry,
        SensorErrors(**{**_without_errors(), **errors}),
        np.random.default_rng(2),
    )
    worn = replace(worn, slip_time=0.6)
    read = sensors.simulate_inertial(worn, k, 1 / STEP, np.random.default_rng(0))[..., :3]
    q = sensors.sensor_poses(worn, k)[0]
    turned = q[0]
    for w in 0.5 * (read[1:] + read[:-1]):
        turned = quat.multiply(turned, quat.exp(STEP * w))
    off = np.degrees(quat.angle(quat.multiply(quat.conjugate(turned), q[-1])))
    assert off.max() < 0.05
    rigid = replace(worn, slips=None, errors=IDEAL, skin_turn=0 * worn.skin_turn)
    moved = quat.multiply(quat.conjugate(sensors.sensor_poses(rigid, k)[0][-1]), q[-1])
    assert np.degrees(quat.angle(moved)).max() > 2.0  # or nothing was tried


def test_distributions_differ_in_their_tails_alone() -> None:
    rng, tails = np.random.default_rng(1), {}
    for distribution in DISTRIBUTIONS:
        x = draw(rng, distribution, (400_000,))
        assert np.std(x) == pytest.approx(1.0, abs=0.1)
        tails[distribution] = float(np.mean(np.abs(x) > 3.0))
    assert tails["uniform"] == 0.0
    assert tails["heavy-tailed"] > 3 * tails["normal"]


def test_misalignments_of_every_distribution_are_as_large() -> None:
    geometry = sized("left")
    sizes = []
    for distribution in ("listed", *DISTRIBUTIONS):
        worn = [
            sensors.mount_sensors(SEGMENTS, geometry, SensorErrors(distribution=distribution), rng)
            for rng in np.random.default_rng(5).spawn(20)
        ]
        turns = np.array([quat.log(w.q_BS) for w in worn])
        sizes.append(float(np.degrees(np.sqrt((turns**2).mean()))))
    np.testing.assert_allclose(sizes, sizes[0], rtol=0.15)


def _without_errors() -> dict[str, float]:
    return {
        d: getattr(IDEAL, d)
        for d in (
            "gyr_noise",
            "acc_noise",
            "gyr_bias",
            "acc_bias",
            "gyr_scale",
            "acc_scale",
            "cross_axis",
            "gyr_bias_walk",
            "skin_shift",
            "misalignment",
            "misalignment_width",
            "bits",
            "skin_angle",
        )
    }
