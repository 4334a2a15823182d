"""What sensors read, and how they err."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handscope.estimators.data.options import describe
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.motion import make_posture, move_through
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import DEG

T = np.arange(0, 2, 0.01)


def _readings(hand: Any, errors: SensorErrors, rate: float = 100.0, n: int = 200) -> np.ndarray:
    """Of a hand at rest in the flat pose (n, 17, 6)."""
    geometry, rng = sized(hand), np.random.default_rng(4)
    still = move_through([(0.0, task_performance.flat()), (100.0, task_performance.flat())])
    worn = sensors.mount_sensors(SEGMENTS, geometry, errors, rng)
    return sensors.simulate_inertial(
        worn, kinematics.compute_kinematics(still, geometry, np.arange(n) / rate), rate, rng
    )


@pytest.mark.parametrize("hand", ["left", "right"])
def test_at_rest_an_accelerometer_reads_plus_g_upwards_and_a_gyroscope_nothing(hand: Any) -> None:
    read = _readings(hand, IDEAL)
    up = np.array(
        [GRAVITY if hand == "left" else -GRAVITY, 0, 0]
    )  # x is dorsal on the left hand, palmar on the right
    fingers = [SEGMENT[s] for s in SEGMENTS if not s.startswith("thumb")]
    np.testing.assert_allclose(
        read[:, fingers, 3:], np.broadcast_to(up, (200, len(fingers), 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.norm(read[..., 3:], axis=-1), GRAVITY, atol=1e-12)
    np.testing.assert_allclose(read[..., :3], 0.0, atol=1e-12)


def test_a_turning_finger_is_seen_by_its_own_gyroscope_and_by_the_centripetal_acceleration() -> (
    None
):
    geometry, end = sized("left"), make_posture(task_performance.flat(), index_mcp_flexion=80.0)
    motion = move_through([(0.0, task_performance.flat()), (0.5, end)])
    k = kinematics.compute_kinematics(motion, geometry, np.array([0.25]))
    worn = sensors.mount_sensors(("index_proximal",), geometry, IDEAL, np.random.default_rng(0))
    (read,) = sensors.simulate_inertial(worn, k, 100.0, np.random.default_rng(0))[0]
    rate = 1.875 * 80 * DEG / 0.5
    np.testing.assert_allclose(read[:3], [0, 0, rate], atol=1e-9)
    half = 0.5 * geometry.lengths["index_proximal"]
    up = quat.rotate(
        quat.conjugate(k.q_GB[0, SEGMENT["index_proximal"]]), np.array([0, 0, GRAVITY])
    )
    np.testing.assert_allclose(
        read[3:], up + rate**2 * np.array([-0.008, -half, 0.0]), atol=1e-6
    )  # towards the joint


def test_misalignment_turns_readings_by_its_angle() -> None:
    errors = replace(IDEAL, misalignment=7.0)
    read = _readings("left", errors)
    worn = sensors.mount_sensors(SEGMENTS, sized("left"), errors, np.random.default_rng(4))
    np.testing.assert_allclose(quat.angle(worn.q_BS) / DEG, 7.0)
    np.testing.assert_allclose(
        quat.rotate(worn.q_BS, read[0, :, 3:]), _readings("left", IDEAL)[0, :, 3:], atol=1e-9
    )


def test_noise_and_bias_have_the_sizes_of_the_data_sheet() -> None:
    d = SensorErrors()
    sizes = {name: getattr(d, name) for name in ("gyr_noise", "acc_noise", "gyr_bias", "acc_bias")}
    errors, rate, n = replace(IDEAL, **sizes), 100.0, 4000
    read = _readings("left", errors, rate, n) - _readings("left", IDEAL, rate, n)
    noise = read.std(axis=0)
    np.testing.assert_allclose(noise[:, :3].mean(), 0.01 * DEG * np.sqrt(rate / 2), rtol=0.02)
    np.testing.assert_allclose(noise[:, 3:].mean(), 300e-6 * GRAVITY * np.sqrt(rate / 2), rtol=0.02)
    bias = read.mean(axis=0)
    assert 0.3 * DEG < bias[:, :3].std() < 0.7 * DEG
    assert 0.03 < bias[:, 3:].std() < 0.07


def test_readings_stop_at_the_full_scale() -> None:
    geometry = sized("left")
    fast = move_through(
        [
            (0.0, task_performance.flat()),
            (0.05, make_posture(task_performance.flat(), index_mcp_flexion=100.0)),
        ]
    )
    worn = sensors.mount_sensors(("index_distal",), geometry, IDEAL, np.random.default_rng(0))
    read = sensors.simulate_inertial(
        worn,
        kinematics.compute_kinematics(fast, geometry, np.arange(0, 0.05, 0.001)),
        1000.0,
        np.random.default_rng(0),
    )
    assert np.abs(read[..., :3]).max() == 2000 * DEG
    assert np.abs(read[..., 3:]).max() == 16 * GRAVITY


def test_a_seed_draws_the_same_recording_and_another_one_another() -> None:
    made = [
        simulate(["rest"], "left", sized("left"), np.random.default_rng(seed), SensorErrors())
        .samples["imu"]
        .values
        for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(made[0], made[1])
    assert not np.array_equal(made[0], made[2])


def test_every_error_size_names_its_source() -> None:
    assert all(
        option.source and option.unit and option.meaning for option in describe(SensorErrors)
    )


def test_streams_of_a_scenario_share_one_time_base_without_a_seam() -> None:
    made = simulate(
        ["rest", "wiggle", "rest"],
        "left",
        sized("left"),
        np.random.default_rng(1),
        IDEAL,
        rate=128.0,
        forearm_rate=50.0,
    )
    for name, block in made.samples.items():
        np.testing.assert_allclose(np.diff(block.t), 1 / block.stream.rate, atol=1e-9, err_msg=name)
        assert block.t[0] == 0
    np.testing.assert_array_equal(made.truth.t, made.samples["imu"].t)
    assert [e.onset for e in made.events if e.trial_type == "rest"] == [
        0.0,
        pytest.approx(10 + 8.2),
    ]
