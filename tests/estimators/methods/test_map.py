"""Self-calibration as a method: through `process`, as a user meets it."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.options import describe
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FLEXION, JOINT
from handscope.estimators.methods import BATCH
from handscope.estimators.methods import map as method
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.self_calibration.problem import Readings, build_chain
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.artificial_finger import SEGMENTS
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.self_calibration.fingers import recorded, stiffened, watched

DEG = np.pi / 180
METHOD = BATCH["map"]
PRINTED = METHOD.Params(
    hand_skin=0.0
)  # soft fingers on a rigid board, which nothing but the option tells


def _with(
    recording: Simulated, values: np.ndarray, start: float = 0.0, stop: float = np.inf
) -> Simulated:
    block = recording.samples["imu"]
    return replace(
        recording, samples={"imu": Block(block.stream, block.t, values).between(start, stop)}
    )


@pytest.fixture(scope="module")
def gapped() -> Simulated:
    """A finger whose last sensor misses half a second: what follows it is long enough."""
    recording = recorded(2, 16.0, skin=True)
    values = recording.samples["imu"].values.copy()
    values[300:350, 3] = np.nan
    return _with(recording, values)


@pytest.fixture(scope="module")
def processed(gapped: Simulated) -> Processed:
    return process(METHOD, PRINTED, gapped)


def test_a_finger_is_followed_without_pose_and_magnetometer(
    processed: Processed, gapped: Simulated
) -> None:
    moved, truth = processed.trajectory, gapped.truth
    np.testing.assert_allclose(moved.t, truth.t, atol=1e-9)
    inside = moved.t > 3.5
    for joint in ("index_mcp", "index_pip", "index_dip"):
        off = (moved.angles - truth.angles)[:, JOINT[joint], FLEXION]
        assert np.sqrt(np.nanmean(off[inside] ** 2)) < 1.5 * DEG


def test_its_calibration_holds_seats_places_lengths_and_biases(
    processed: Processed, gapped: Simulated
) -> None:
    found, worn = processed.calibrations[0], gapped.sensors
    assert found.source == "self-calibration"
    assert (
        found.span == pytest.approx((3.5, 16.0), abs=0.05) and found.end == found.t
    )  # orientations hold at an instant
    for k, name in enumerate(SEGMENTS[1:3], 1):
        assert found.geometry.lengths[name] == pytest.approx(artificial_finger.HINGES, rel=0.02)
        assert found.lengths_sd[name] < 0.02 * artificial_finger.HINGES
        np.testing.assert_allclose(found.p_BS[name], worn.p_BS[k], atol=1e-3)
        square = [
            0,
            2,
        ]  # to the hinges' common axis, y of these sensors: along it a bias that all sensors share is told by no movement of the finger
        np.testing.assert_allclose(
            found.gyr_bias[name][square], worn.bias[k, :3][square], atol=0.1 * DEG
        )
        np.testing.assert_allclose(
            found.acc_bias[name][square], worn.bias[k, 3:6][square], atol=0.05
        )


def test_where_the_live_meter_says_enough_the_lengths_are_found(
    processed: Processed, gapped: Simulated
) -> None:
    assert [o.share for o in watched(gapped)] == [1.0, 1.0, 1.0]
    assert set(processed.calibrations[0].lengths_sd) == {"index_proximal", "index_middle"}


def test_what_is_told_of_errors_holds(processed: Processed, gapped: Simulated) -> None:
    """Seats, places and angles lie within three of their standard deviations; where a mounting had to be believed, these say so."""
    moved, truth, found = processed.trajectory, gapped.truth, processed.calibrations[0]
    assert moved.angles_sd is not None and moved.tips_sd is not None
    inside = (moved.t > 3.5) & (moved.t < 15.9)
    root = 0.05 * np.abs(
        gapped.geometry.joint_positions["index_mcp"]
    )  # of where the finger hangs on the hand nothing is told by its movement
    assert (moved.tips_sd[inside, 1] >= root - 1e-9).all()
    assert np.linalg.norm(found.p_BS_sd["hand"]) > 0.05 * np.linalg.norm(
        np.subtract(*_roots(gapped))
    )
    for joint, largest in (("index_mcp", 6.0), ("index_pip", 2.0), ("index_dip", 6.0)):
        off, sd = (
            (a[inside, JOINT[joint], FLEXION])
            for a in (moved.angles - truth.angles, moved.angles_sd)
        )
        assert np.sqrt(np.mean((off / sd) ** 2)) < 3.0
        assert sd.max() < largest * DEG
    for k, name in enumerate(SEGMENTS[1:3], 1):
        assert (
            np.abs(
                quat.log(quat.multiply(found.q_BS[name], quat.conjugate(gapped.sensors.q_BS[k])))
            )
            < 3 * found.q_BS_sd[name]
        ).all()
        assert (np.abs(found.p_BS[name] - gapped.sensors.p_BS[k]) < 3.5 * found.p_BS_sd[name]).all()
        assert found.p_BS_sd[name].max() < 1e-3
    assert np.isfinite(moved.tips_sd[:, 1]).all() and moved.tips_sd[inside, 1].max() < 0.02


def _roots(made: Simulated) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return made.geometry.joint_positions["index_mcp"], made.geometry.joint_positions["middle_mcp"]


@pytest.mark.slow
def test_where_fingers_have_no_skin_the_hand_is_not_believed_to_have_any() -> None:
    """A hand's skin that slides with the joint looks like length: where it may, a length is not known to a hundredth."""
    recording = recorded(2, 16.0, skin=False)
    (found,) = process(METHOD, METHOD.Params(), recording).calibrations
    for name in SEGMENTS[1:3]:
        off = found.geometry.lengths[name] - artificial_finger.HINGES
        assert abs(off) < 3.0 * found.lengths_sd[name] < 0.01 * artificial_finger.HINGES


@pytest.mark.slow
def test_a_stiff_joint_is_named_and_the_rest_is_calibrated() -> None:
    """PIP stays at 20 deg: its neighbours' lengths stay as given, and what is told of angles holds."""
    recording = stiffened(4, 11.0, {"index_pip_flexion": 20.0})
    done = process(METHOD, METHOD.Params(), recording)
    (messages,) = (w for w in done.warnings if "hardly moved" in w)
    assert messages.startswith("index_pip (")
    assert "the lengths of index_proximal, index_middle stay as given" in messages
    assert dict(done.calibrations[0].lengths_sd) == {}
    assert {o.joint for o in watched(recording) if o.share < 0.5} == {"index_pip"}, (
        "so did the live meter"
    )
    assert not {"index_proximal", "index_middle"} & set(done.calibrations[0].p_BS)
    moved, truth = done.trajectory, recording.truth
    for joint in ("index_mcp", "index_pip", "index_dip"):
        off, sd = (
            (a[:, JOINT[joint], FLEXION]) for a in (moved.angles - truth.angles, moved.angles_sd)
        )
        assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
        assert sd.mean() < 25.0 * DEG


def test_a_hand_that_lay_still_is_told_what_to_do() -> None:
    recording = recorded(2, 16.0, skin=True)
    values = np.tile(recording.samples["imu"].values[:200], (8, 1, 1))
    with pytest.raises(
        InputError, match=r"turned at 0 deg/s on average .* move the hand in all directions"
    ):
        process(METHOD, METHOD.Params(), _with(recording, values))


def test_gaps_that_leave_no_long_stretch_are_told() -> None:
    recording = recorded(2, 16.0, skin=True)
    values = recording.samples["imu"].values.copy()
    values[800:850, 3] = np.nan
    with pytest.raises(
        InputError, match=r"\(1, most of index_distal\) leave no longer stretch than 8\.0 s"
    ):
        process(METHOD, METHOD.Params(), _with(recording, values))


def test_five_seconds_are_too_few() -> None:
    recording = recorded(2, 16.0, skin=True)
    short = _with(recording, recording.samples["imu"].values, 4.0, 9.01)
    with pytest.raises(InputError, match=r"5\.0 s of movement, self-calibration needs 10 s"):
        process(METHOD, METHOD.Params(), short)
    assert max(o.share for o in watched(short, start=4.0, stop=9.0)) < 0.6, (
        "nor does the live meter say enough"
    )


@pytest.mark.parametrize("spoke", [0, pytest.param(1150, marks=pytest.mark.slow)])
def test_a_last_sensor_that_falls_silent_costs_its_own_segment_alone(spoke: int) -> None:
    """Never heard, or heard for a while: its neighbours are found, and of its own joint nothing is claimed."""
    recording = recorded(2, 16.0, skin=True)
    values = recording.samples["imu"].values.copy()
    values[spoke:, 3] = np.nan
    done = process(METHOD, PRINTED, _with(recording, values))
    messages = (
        "index: the sensor of index_distal gave no samples; it is calibrated without index_distal"
    )
    assert any(w.startswith(messages) for w in done.warnings) == (not spoke)
    found, moved, truth = done.calibrations[0], done.trajectory, recording.truth
    assert found.geometry.lengths["index_proximal"] == pytest.approx(
        artificial_finger.HINGES, rel=0.02
    )
    assert "index_proximal" in found.p_BS and ("index_middle" in found.p_BS) == bool(spoke)
    assert moved.angles_sd is not None
    off, sd = (
        a[:, JOINT["index_pip"], FLEXION] for a in (moved.angles - truth.angles, moved.angles_sd)
    )
    assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
    assert sd.max() < 6.0 * DEG
    of_dip = moved.angles_sd[spoke + 10 :, JOINT["index_dip"], FLEXION]
    assert (np.isnan(of_dip) | (of_dip > 30.0 * DEG)).all()


@pytest.mark.slow
def test_knocks_on_gyroscopes_are_named_and_cost_nothing() -> None:
    """One sample of three sensors off by hundreds of deg/s: a turn of some degrees that never was."""
    recording, rng = recorded(2, 12.0, skin=True), np.random.default_rng(102)
    values, knocks = recording.samples["imu"].values.copy(), {1: 7.57, 2: 7.94, 3: 8.31}
    for row, at in knocks.items():
        values[round(100 * at), row, :3] += 300 * DEG * rng.standard_normal(3)
    done = process(METHOD, METHOD.Params(), _with(recording, values))
    for row, at in knocks.items():
        messages = (
            f"the gyroscope of {SEGMENTS[row]} contradicts the accelerations once, at {at:.1f} s"
        )
        assert any(w.startswith(messages) for w in done.warnings)
    assert not any(
        word in w
        for w in done.warnings
        for word in ("movement says otherwise", "off its nominal", "not observable")
    )
    moved, truth = done.trajectory, recording.truth
    assert moved.angles_sd is not None
    for joint in ("index_mcp", "index_pip", "index_dip"):
        off, sd = (
            a[:, JOINT[joint], FLEXION] for a in (moved.angles - truth.angles, moved.angles_sd)
        )
        assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
        assert np.std(off) < 0.5 * DEG


def test_a_finger_of_which_the_first_sensor_is_silent_is_refused_by_name() -> None:
    recording = recorded(2, 16.0, skin=True)
    values = recording.samples["imu"].values.copy()
    values[:, 1] = np.nan
    with pytest.raises(
        InputError,
        match="index: the sensor of index_proximal gave no samples; it is not calibrated",
    ):
        process(METHOD, METHOD.Params(), _with(recording, values))


def test_a_sensor_that_was_at_its_limit_most_of_the_time_is_told_from_a_silent_one() -> None:
    recording = recorded(2, 16.0, skin=True)
    block = recording.samples["imu"]
    narrow = replace(
        block, stream=replace(block.stream, full_scale={**block.stream.full_scale, "acc": 6.0})
    )
    recording = replace(recording, samples={"imu": narrow})
    with pytest.raises(
        InputError,
        match="index: the sensor of hand was at its limit in more than half of its samples; set a larger",
    ):
        process(METHOD, METHOD.Params(), recording)


def test_an_event_says_when_the_hand_moved_freely() -> None:
    recording = replace(recorded(2, 16.0, skin=True), events=(Event(3.0, 4.0, "free_movement"),))
    with pytest.raises(InputError, match=r"4\.0 s of movement"):
        process(METHOD, METHOD.Params(), recording)


def test_without_the_hands_sensor_there_is_nothing_to_relate_fingers_to() -> None:
    recording = recorded(2, 16.0, skin=True)
    block = recording.samples["imu"]
    fingers = Block(replace(block.stream, sensors=SEGMENTS[1:]), block.t, block.values[:, 1:])
    with pytest.raises(InputError, match="no inertial sensor on the hand"):
        process(METHOD, METHOD.Params(), replace(recording, samples={"imu": fingers}))


def test_every_option_says_what_it_means() -> None:
    for option in describe(METHOD.Params):
        assert option.meaning, option.name
        assert option.source, option.name
        assert option.unit or option.kind != "float", option.name


@pytest.mark.parametrize(
    ("seconds", "frequency", "every"),
    [(40.0, 1.0, 4), (40.0, 4.0, 2), (40.0, 6.0, 1), (20.0, 1.0, 2), (15.0, 1.0, 1)],
)
def test_as_many_samples_are_solved_for_as_the_movement_needs(
    seconds: float, frequency: float, every: int
) -> None:
    """Ten in a period of the fastest, 25 Hz, and a thousand."""
    assert method._kept_samples(METHOD.Params(), [_turning(seconds, frequency)]) == every


def test_where_left_out_samples_hide_a_knock_all_limbs_are_solved_with_every_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = []

    def calibrated(
        params: object, recording: object, limb: object, every: int, done: object
    ) -> None:
        seen.append(every)

    monkeypatch.setattr(method, "_calibrate_limb", calibrated)
    limbs = [_turning(40.0, 1.0)] * 2
    method._calibrate_limbs(METHOD.Params(), recorded(2, 1.0), limbs, lambda share: None)
    assert seen == [4, 4, 1, 1]


def _turning(seconds: float, frequency: float) -> method._Limb:
    """Two sensors that turn to and fro so often a second."""
    t = np.arange(round(100 * seconds)) / 100
    rates = np.sin(2 * np.pi * frequency * t)[:, None, None] * np.ones((2, 3))
    sure = np.ones((len(t), 2))
    read = Readings(0.01, rates, np.zeros_like(rates), sure, sure)
    return method._Limb("index", build_chain(("hand", "index_proximal")), t, read)
