"""Calibration from a pose: what it finds, and which poses it refuses with which words."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import GYR, MAG, Block, Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import DEG, calibrated, pose_and_wiggle, tracked, with_samples

STILL = Pose(1.5, 3.0, (0.0, -45 * DEG, 60 * DEG))


def _calibrate(recording: Simulated, pose: Pose = STILL, **options: float | str) -> Calibration:
    blocks = list(recording.samples.values())
    return initial_pose.calibrate(
        m2.Params(**options), recording.hand, recording.geometry, recording.mounting, blocks, pose
    )


def _changed(recording: Simulated, name: str, change: "object") -> Simulated:
    """The recording with the values of one stream changed by a function that works in place on (t,
    values)."""
    block = recording.samples[name]
    values = block.values.copy()
    change(block.t, values)
    return with_samples(
        recording, {**recording.samples, name: Block(block.stream, block.t, values)}
    )


def test_biases_are_found_and_misalignment_but_for_its_part_about_the_vertical() -> None:
    recording = pose_and_wiggle("right", replace(IDEAL, gyr_bias=0.5, misalignment=5.0))
    found = calibrated(recording)
    hand = recording.sensors.segments.index("hand")
    for k, segment in enumerate(recording.sensors.segments):
        np.testing.assert_allclose(
            found.gyr_bias[segment], recording.sensors.bias[k, :3], atol=1e-9
        )
        assert found.quality[segment].bias == pytest.approx(
            np.linalg.norm(recording.sensors.bias[k, :3]), abs=1e-9
        )
        if not segment.startswith("thumb"):  # the pose turns the thumb's frames against the hand's
            # the hand's own cannot be seen
            true = quat.multiply(
                quat.conjugate(recording.sensors.q_BS[hand]), recording.sensors.q_BS[k]
            )
            error = quat.log(quat.multiply(found.q_BS[segment], quat.conjugate(true)))
            up = quat.rotate(
                quat.conjugate(
                    quat.multiply(found.q_GS[segment], quat.conjugate(found.q_BS[segment]))
                ),
                np.array([0, 0, 1.0]),
            )
            assert np.linalg.norm(error - (error @ up) * up) < 0.02 * DEG


def test_the_hand_lies_palm_down_with_its_fingers_along_the_global_y_axis(
    simulated: Simulated,
) -> None:
    found, k = calibrated(simulated), np.searchsorted(simulated.truth.t, STILL.onset)
    for s, segment in enumerate(SEGMENTS):
        assert quat.angle(quat.relative(simulated.truth.q_GS[k, s], found.q_GS[segment])) < 1e-6


def test_the_paper_keeps_the_nominal_mounting_and_takes_the_heading_only() -> None:
    recording = pose_and_wiggle("left", SensorErrors())
    found = calibrated(recording, m2.Params(alignment="heading"))
    for segment in recording.sensors.segments:
        np.testing.assert_array_equal(found.q_BS[segment], quat.IDENTITY)
    true = quat.multiply(recording.truth.q_GS[200, 0], recording.sensors.q_BS[0])
    # heading of the pose, inclination measured
    assert quat.angle(quat.relative(true, found.q_GS["forearm"])) < 15 * DEG


def test_a_nominal_mounting_is_the_starting_point() -> None:
    turned = {"index_distal": quat.about(1, np.pi)}
    recording = pose_and_wiggle("left")
    k = recording.samples["imu"].stream.sensors.index("index_distal")

    def mount(t: np.ndarray, values: np.ndarray) -> None:
        for axes in (slice(0, 3), slice(3, 6)):
            values[:, k, axes] = quat.rotate(quat.about(1, -np.pi), values[:, k, axes])

    found = calibrated(replace(_changed(recording, "imu", mount), mounting=turned))
    assert quat.angle(quat.relative(turned["index_distal"], found.q_BS["index_distal"])) < 1e-6
    assert found.quality["index_distal"].misalignment < 1e-6


def test_of_a_long_pose_the_stillest_stretch_counts() -> None:
    recording = pose_and_wiggle("left")

    def tremble(t: np.ndarray, values: np.ndarray) -> None:
        values[:, 3, 0] += np.where(t < 1.2, 0.02 * np.sin(60 * t), 0.0)
        values[:, 5] = np.nan  # a dead sensor must not hide the others' trembling

    found = _calibrate(
        _changed(recording, "imu", tremble),
        Pose(0.9, 3.9, STILL.thumb_cmc),
        pose_rate=1000.0,
        pose_tilt=90.0,
    )
    assert found.t >= 1.2


def test_streams_that_are_not_inertial_do_not_matter() -> None:
    recording = pose_and_wiggle("left")
    mag = Stream("mag", ("hand",), (MAG,), 50.0)
    with_mag = with_samples(
        recording,
        {"mag": Block(mag, np.arange(700) / 50, np.zeros((700, 1, 3))), **recording.samples},
    )
    assert _calibrate(with_mag).q_GS.keys() == _calibrate(recording).q_GS.keys()


def test_a_sensor_with_few_or_no_samples_in_the_pose_is_not_calibrated() -> None:
    recording = pose_and_wiggle("left")
    columns = {
        name: recording.samples["imu"].stream.sensors.index(name)
        for name in ("ring_distal", "index_distal")
    }

    def fall_silent(t: np.ndarray, values: np.ndarray) -> None:
        values[t < 3.3, columns["ring_distal"]] = np.nan
        values[:, columns["index_distal"]] = 0.0

    found = _calibrate(_changed(recording, "imu", fall_silent))
    assert set(SEGMENTS) - set(found.q_GS) == {"ring_distal", "index_distal"}


def _refusal(recording: Simulated, pose: Pose = STILL) -> str:
    with pytest.raises(InputError) as refusal:
        _calibrate(recording, pose)
    return str(refusal.value)


def test_a_short_pose_is_refused() -> None:
    warnings = _refusal(pose_and_wiggle("left"), Pose(1.5, 2.0))
    assert "2.0 s of samples" in warnings
    assert "3 s are needed" in warnings


def test_a_pose_outside_the_recording_is_refused() -> None:
    recording = pose_and_wiggle("left")
    t = recording.samples["imu"].t
    words = f"the recording goes from {t[0]:.1f} to {t[-1]:.1f} s"
    for onset in (500.0, -1.7e9):
        assert words in _refusal(recording, Pose(onset, 3.0))


def test_a_pose_without_the_hands_sensor_is_refused() -> None:
    recording = pose_and_wiggle("left")

    def no_hand(t: np.ndarray, values: np.ndarray) -> None:
        values[:, recording.samples["imu"].stream.sensors.index("hand")] = np.nan

    assert "hand's sensor" in _refusal(_changed(recording, "imu", no_hand))


def test_a_hand_with_two_samples_beside_a_whole_forearm_is_refused() -> None:
    recording = pose_and_wiggle("left")
    imu = recording.samples["imu"]
    few = Block(imu.stream, imu.t[200:202], imu.values[200:202])
    assert "hand's sensor" in _refusal(with_samples(recording, {**recording.samples, "imu": few}))


@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("turned at", lambda t: np.where(t > 3.5, 6.0, 0.0)),
        ("turned steadily", lambda t: np.full_like(t, 21.0)),
    ],
)
def test_a_hand_that_turns_is_refused_by_the_sensors_name(words: str, change: "object") -> None:
    recording = pose_and_wiggle("left")
    k = recording.samples["imu"].stream.sensors.index("little_middle")

    def turn(t: np.ndarray, values: np.ndarray) -> None:
        values[:, k, 1] += change(t) * DEG

    warnings = _refusal(_changed(recording, "imu", turn))
    assert f"little_middle {words}" in warnings
    assert "hold the pose still" in warnings


def test_a_hand_that_tilts_is_refused() -> None:
    recording = pose_and_wiggle("left")

    def tilt(t: np.ndarray, values: np.ndarray) -> None:
        values[:, 4, 5] += np.where(t > 3, 9.81 * np.sin(4 * DEG), 0.0)

    assert "tilted by" in _refusal(_changed(recording, "imu", tilt))


def test_a_moving_hand_is_refused() -> None:
    assert "not still" in _refusal(pose_and_wiggle("left"), Pose(6.5, 4.0))


def test_an_accelerometer_that_is_off_is_a_warning() -> None:
    recording = pose_and_wiggle("left")

    def scale(t: np.ndarray, values: np.ndarray) -> None:
        values[:, 7, 3:] *= 1.2

    found = _calibrate(_changed(recording, "imu", scale))
    assert [
        w
        for w in found.warnings
        if recording.samples["imu"].stream.sensors[7] in w and "11.8 m/s^2" in w
    ]


def test_a_pose_event_tells_the_thumbs_angles_in_degrees() -> None:
    details = {
        "thumb_cmc_deviation_deg": "-45",
        "thumb_cmc_pronation_deg": 60.0,
        "thumb_cmc_flexion_deg": None,
    }
    pose = initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", details))
    assert pose == Pose(1.0, 3.0, (0.0, pytest.approx(-45 * DEG), pytest.approx(60 * DEG)))
    assert initial_pose.pose_of(Event(1.0, 3.0, "initial_pose")).thumb_cmc == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("value", ["sideways", "nan", [1.0]])
def test_a_thumb_angle_that_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(InputError, match="number of degrees"):
        initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", {"thumb_cmc_flexion_deg": value}))


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("index_mcp_deviation_deg", 900.0),
        ("wrist_flexion_deg", -130.0),
        ("thumb_ip_flexion_deg", 1e6),
    ],
)
def test_a_pose_angle_that_no_joint_reaches_is_refused_with_what_it_can_do(
    column: str, value: float
) -> None:
    with pytest.raises(InputError, match=f"{column}; this joint goes from -"):
        initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", {column: value}))
    beyond = {
        "index_pip_flexion_deg": -45.0,
        "little_mcp_deviation_deg": 60.0,
    }  # stiff or lax joints
    initial_pose.pose_of(Event(1.0, 3.0, "initial_pose", beyond))


def test_columns_of_a_pose_that_are_no_freedom_are_named_in_a_warning() -> None:
    details = {
        "index_mcp_deviaton_deg": 5.0,
        "index_pip_deviation_deg": 5.0,
        "index_mcp_deviation_deg": 0.0,
        "index_mcp_deviation_sd_deg": 1.0,
        "held_by": "therapist",
    }
    pose = initial_pose.pose_of(Event(1.5, 3.0, "initial_pose", details))
    assert pose.measured == {}
    (warning,) = _calibrate(pose_and_wiggle("left", IDEAL), pose).warnings
    assert "index_mcp_deviaton_deg, index_pip_deviation_deg" in warning


def test_another_recordings_headings_are_taken_over_with_this_ones_inclination() -> None:
    recording = pose_and_wiggle("left")
    found = calibrated(recording)
    beginning = [b.between(STILL.onset, STILL.onset + 0.5) for b in recording.samples.values()]
    for segment, q_GS in initial_pose.reorient(found, beginning).items():
        assert quat.angle(quat.relative(found.q_GS[segment], q_GS)) < 1e-6
    assert GYR in beginning[0].stream.quantities


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_inclination_in_which_the_sensors_agree_lessens_the_effect_of_a_hand_sensor_askew(
    hand: str,
) -> None:
    recording = pose_and_wiggle(hand, replace(IDEAL, misalignment=7.5, misalignment_width=2.5))
    error = {}
    for alignment in ("full", "common", "heading"):
        params = m2.Params(alignment=alignment)
        moved = tracked(recording, params, calibrated(recording, params))
        error[alignment] = float(np.sqrt(np.nanmean((moved.angles - recording.truth.angles) ** 2)))
    assert error["common"] < 0.8 * error["full"] < 0.8 * error["heading"]


def test_of_a_long_pose_a_stretch_is_taken_in_which_every_sensor_was_there() -> None:
    recording = _long_pose()
    index = [
        recording.samples["imu"].stream.sensors.index(s)
        for s in ("index_proximal", "index_middle", "index_distal")
    ]

    def without_index(t: np.ndarray, values: np.ndarray) -> None:
        values[np.ix_((t > 3.0) & (t < 5.5), index)] = np.nan

    found = _calibrate(_changed(recording, "imu", without_index), Pose(1.5, 9.0, STILL.thumb_cmc))
    assert found.t >= 5.5 - 0.3  # a tenth of the samples may be missing
    assert "index_middle" in found.q_BS


def test_a_gap_in_a_long_pose_does_not_refuse_it() -> None:
    recording = _long_pose()
    block = recording.samples["imu"]
    keep = (block.t < 3.0) | (block.t > 6.2)
    cut = with_samples(recording, {"imu": Block(block.stream, block.t[keep], block.values[keep])})
    found = _calibrate(cut, Pose(1.5, 9.0, STILL.thumb_cmc))
    assert found.t >= 6.2


def _long_pose() -> Simulated:
    g = sized("left")
    return simulate_performances(
        [task_performance.initial_pose(g, 12.0)],
        "left",
        g,
        np.random.default_rng(2),
        SensorErrors(),
    )
