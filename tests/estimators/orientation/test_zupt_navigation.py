"""The hand's path against the simulator's truth: reaches with the wrist turning, between
standstills."""

from dataclasses import fields

import numpy as np
import pytest

from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import SEGMENT, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation import zupt_navigation
from handscope.estimators.orientation.zupt_navigation import HandFilterParams, HandPath
from handscope.estimators.simulation import kinematics
from handscope.estimators.simulation.motion import make_posture, move_through
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import InertialGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import calibrated

PARAMS = HandFilterParams(gyr_reading="instant")  # as the simulator reads rates
AWAY = {
    "wrist_x": 0.15,
    "wrist_y": 0.25,
    "wrist_z": 0.10,
    "forearm_flexion": 15.0,
    "wrist_flexion": 20.0,
}


def _reaching(
    hand: Hand, errors: SensorErrors, seed: int = 1, rate: float = 100.0, reaches: int = 3
) -> tuple[Simulated, Array]:
    """A pose, then reaches of 0.9 s to and fro with rests of 1 s; the recording and where the
    hand's sensor truly was (n, 3)."""
    geometry, flat = sized(hand), task_performance.flat()
    pose = task_performance.initial_pose(geometry)
    points, t = [(0.0, task_performance.relaxed())], 0.0
    for k in range(2 * reaches):
        points += [
            (t + 1.0, points[-1][1]),
            (
                t + 1.9,
                make_posture(task_performance.relaxed(), **AWAY)
                if k % 2 == 0
                else task_performance.relaxed(),
            ),
        ]
        t += 1.9
    reach = Performance(move_through([*points, (t + 1.0, points[-1][1])]), ())
    assert flat.shape == points[0][1].shape
    made = simulate_performances(
        [pose, reach],
        hand,
        geometry,
        np.random.default_rng(seed),
        errors,
        glove=InertialGlove(rate=rate, segments=("hand", "index_distal")),
    )
    lever = made.sensors.p_BS[made.sensors.segments.index("hand")]
    places, begin = [], 0.0
    for part in (pose, reach):
        t_own = made.samples["imu"].t
        t_own = (
            t_own[(t_own >= begin - 1e-9) & (t_own < begin + part.motion.duration - 1e-9)] - begin
        )
        k = kinematics.compute_kinematics(part.motion, geometry, t_own)
        places.append(
            k.p[:, SEGMENT["hand"]]
            + quat.rotate(k.q_GB[:, SEGMENT["hand"]], np.tile(lever, (len(t_own), 1)))
        )
        begin += part.motion.duration
    return made, np.concatenate(places)


def _path(
    recording: Simulated, cuts: tuple[int, ...] = (), params: HandFilterParams = PARAMS
) -> HandPath:
    calibration = calibrated(recording)
    block = recording.samples["imu"].between(calibration.t, np.inf)
    state, pieces = zupt_navigation.start(params, calibration), []
    for first, last in zip((0, *cuts), (*cuts, len(block.t))):
        state, piece = zupt_navigation.step(
            params, state, Block(block.stream, block.t[first:last], block.values[first:last])
        )
        pieces.append(piece)
    state, last_piece = zupt_navigation.finish(params, state)
    return HandPath(
        *(
            np.concatenate([getattr(p, f.name) for p in (*pieces, last_piece)])
            for f in fields(HandPath)
        )
    )


def _off(path: HandPath, recording: Simulated, truth: Array) -> Array:
    """Distance (n,) from the truth, both counted from the path's first sample and turned to one
    heading."""
    true = truth[-len(path) :]
    q = calibrated(recording).q_GS["hand"]
    turn = quat.twist(
        quat.multiply(
            recording.truth.q_GS[len(truth) - len(path), SEGMENT["hand"]], quat.conjugate(q)
        ),
        2,
    )
    aligned = quat.rotate(np.tile(quat.about(2, turn), (len(path), 1)), path.p - path.p[0])
    return np.asarray(np.linalg.norm(aligned - (true - true[0]), axis=1))


@pytest.mark.parametrize("hand", ["left", "right"])
def test_without_errors_a_reach_is_followed_to_a_centimetre(hand: Hand) -> None:
    recording, truth = _reaching(hand, IDEAL)
    path = _path(recording)
    assert (
        np.linalg.norm(truth[-1] - truth[0])
        < 1e-6
        < 0.25
        < np.linalg.norm(truth - truth[0], axis=1).max()
    )
    assert _off(path, recording, truth).max() < 0.01


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_with_a_sensors_errors_reaches_keep_their_places_within_what_the_deviation_says(
    seed: int,
) -> None:
    recording, truth = _reaching("left", SensorErrors(), seed)
    path = _path(recording)
    off, sd = _off(path, recording, truth), np.linalg.norm(path.p_sd, axis=1)
    assert off.max() < 0.10
    assert np.mean(off < 2 * sd) > 0.9


def test_standstills_are_the_rests_and_no_more() -> None:
    recording, truth = _reaching("left", SensorErrors())
    path = _path(recording)
    speed = np.linalg.norm(np.gradient(truth[-len(path) :], path.t, axis=0), axis=1)
    assert path.still[speed > 0.1].mean() < 0.01
    rests = np.convolve(speed < 1e-4, np.ones(40), "same") > 39.5
    assert path.still[rests].mean() > 0.8


def test_cutting_the_blocks_anywhere_changes_no_bit() -> None:
    recording, _ = _reaching("left", SensorErrors(), reaches=1)
    whole, cut = _path(recording), _path(recording, (1, 2, 77, 78, 300, 555))
    for f in fields(HandPath):
        np.testing.assert_array_equal(getattr(whole, f.name), getattr(cut, f.name))


def test_after_a_long_gap_the_velocity_is_forgotten_and_the_deviation_says_so() -> None:
    recording, _ = _reaching("left", SensorErrors())
    block = recording.samples["imu"]
    values = block.values.copy()
    values[(block.t > 7.3) & (block.t < 7.9), 0] = np.nan
    gone = Simulated(
        recording.hand,
        recording.geometry,
        {"imu": Block(block.stream, block.t, values)},
        recording.events,
        recording.truth,
        recording.sensors,
    )
    path = _path(gone)
    assert np.isfinite(path.p).all()
    assert path.p_sd[path.t < 7.3].max() < 0.2 < path.p_sd[path.t > 7.9].min()
    assert np.linalg.norm(path.v[-1]) < 0.05


def test_the_transition_is_the_derivative_of_the_integration() -> None:
    recording, _ = _reaching("left", SensorErrors(), reaches=1)
    calibration = calibrated(recording)
    state = zupt_navigation.start(PARAMS, calibration)
    t, samples = (
        0.05 + np.arange(5) * 0.01,
        np.random.default_rng(5).normal(0, [1, 1, 1, 2, 2, 2], (5, 6)) + [0, 0, 0, 9, 1, 0],
    )
    dt = np.full(5, 0.01)

    def path_error(error: Array) -> Array:
        turned = quat.multiply(quat.exp(error[6:9]), state.q_GH)
        off = zupt_navigation.State(
            state.q_BS,
            None,
            turned,
            state.p + error[:3],
            state.v + error[3:6],
            state.bias + error[9:],
            state.covariance,
            state.recent,
            state.waiting,
            state.waiting_t,
        )
        q, p, v, _ = zupt_navigation._integrate(PARAMS, off, dt, samples)
        return np.concatenate([p[-1], v[-1], q[-1]])

    q_0 = path_error(np.zeros(15))[6:]
    unit = np.diag(np.full(15, 1.0))
    still = zupt_navigation.State(
        state.q_BS,
        None,
        state.q_GH,
        state.p,
        state.v,
        state.bias,
        unit,
        state.recent,
        state.waiting,
        state.waiting_t,
    )
    noiseless = HandFilterParams(
        gyr_reading="instant", acc_noise=0.0, gyr_noise=1e-6, gyr_bias_walk=0.0
    )
    FFt = zupt_navigation._integrate(noiseless, still, dt, samples)[3]
    F = np.empty((15, 15))
    for k in range(15):
        step = 1e-5
        plus, minus = path_error(step * np.eye(15)[k]), path_error(-step * np.eye(15)[k])
        dth = quat.log(quat.multiply(plus[6:], quat.conjugate(q_0))) - quat.log(
            quat.multiply(minus[6:], quat.conjugate(q_0))
        )
        F[:9, k] = np.concatenate([plus[:6] - minus[:6], dth]) / (2 * step)
        F[9:, k] = np.eye(15)[k, 9:]
    assert t[0] == pytest.approx(0.05)
    np.testing.assert_allclose(FFt, F @ F.T, atol=2e-4)
