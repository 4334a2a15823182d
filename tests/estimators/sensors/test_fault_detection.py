"""Faults of sensors: each is found and named with its fix, and nothing is found in healthy
recordings."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import ACC, GYR, MAG, Block
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import b, ekf, m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import findings_of, process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.sensors.imu_calibration import ImuCalibration, apply
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL, LSM330DLC_HMC5983, SensorErrors
from tests.schedule import swept
from tests.simulated import in_strips

TASKS = [name for name in task_performance.TASKS if name != "initial_pose"]
KEPT = (
    "rom_wrist_deviation",
    "tapping",
    "tremor_rest",
    "powerglove_10_index_fast",
)  # one of each kind
QUARTER = np.pi / 2


@lru_cache(maxsize=8)  # as many as tests share; each is some 20 MB
def made(
    task: str,
    hand: str = "left",
    seed: int = 0,
    errors: SensorErrors = SensorErrors(),  # noqa: B008
    magnetic: bool = False,
) -> Simulated:
    geometry, field = sized(hand), homogeneous() if magnetic else None  # type: ignore[arg-type]
    return simulate(
        ["initial_pose", task], hand, geometry, np.random.default_rng(seed), errors, field=field
    )  # type: ignore[arg-type]


def found(recording: Simulated) -> list[Finding]:
    return list(findings_of(recording, calibrate(m2.Params(), recording)[0]))


def changed(
    recording: Simulated, change: Callable[[Array, tuple[str, ...]], None], stream: str = "imu"
) -> Simulated:
    """The recording with its samples (n, sensors, axes) changed in place by a function."""
    block = recording.samples[stream]
    values = block.values.copy()
    change(values, block.stream.sensors)
    return replace(
        recording, samples={**recording.samples, stream: Block(block.stream, block.t, values)}
    )


def turned(recording: Simulated, sensor: str, q: Array) -> Simulated:
    def turn(values: Array, names: tuple[str, ...]) -> None:
        for axes in (slice(0, 3), slice(3, 6)):
            values[:, names.index(sensor), axes] = quat.rotate(
                quat.conjugate(q), values[:, names.index(sensor), axes]
            )

    return changed(recording, turn)


def exchanged(recording: Simulated, one: str, other: str) -> Simulated:
    def exchange(values: Array, names: tuple[str, ...]) -> None:
        a, z = ([names.index(s) for s in CHAINS[f]] for f in (one, other))
        values[:, [*a, *z]] = values[:, [*z, *a]]

    return changed(recording, exchange)


@pytest.mark.parametrize("task", swept(TASKS, kept=KEPT))
@pytest.mark.parametrize("hand", swept(["left", "right"], kept=["left"]))
def test_nothing_is_found_in_healthy_recordings(task: str, hand: str) -> None:
    for seed, errors in enumerate((SensorErrors(), LSM330DLC_HMC5983, IDEAL)):
        assert found(made(task, hand, seed, errors, magnetic=seed == 1)) == []


def test_nothing_is_found_in_a_healthy_glove_of_separate_strips() -> None:
    assert found(in_strips("left")) == []


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("hand", swept(["left", "right"], kept=["left"]))
def test_a_sensor_turned_by_90_deg_is_named_with_the_mounting_that_it_has(
    axis: int, sign: int, hand: str
) -> None:
    q = quat.about(axis, sign * QUARTER)
    for task in ("rom_fist", "open_close", "wiggle"):
        (finding,) = found(turned(made(task, hand), "ring_middle", q))
        assert (finding.sensor, finding.kind, finding.severity) == (
            "ring_middle",
            "turned",
            "fault",
        )
        assert "by about 90 deg about its" in finding.sentence
        given = np.array([float(x) for x in finding.fix.split("[")[1].rstrip("]").split(",")])
        np.testing.assert_allclose(given * np.sign(given[0]), q, atol=1e-3)
        assert (
            found(
                replace(turned(made(task, hand), "ring_middle", q), mounting={"ring_middle": given})
            )
            == []
        )


@pytest.mark.parametrize("axis", range(3))
def test_a_sensor_upside_down_or_back_to_front_is_named(axis: int) -> None:
    (finding,) = found(turned(made("rom_fist"), "index_distal", quat.about(axis, np.pi)))
    assert (finding.sensor, finding.kind) == ("index_distal", "turned")
    assert "by about 180 deg" in finding.sentence


def test_the_hands_own_sensor_is_judged_against_the_fingers() -> None:
    (finding,) = found(turned(made("rom_fist"), "hand", quat.about(2, QUARTER)))
    assert (finding.sensor, finding.kind) == ("hand", "turned")


def test_a_turn_about_the_vertical_is_not_seen_by_gravity_alone() -> None:
    """A limit that the module's header names: the hand's sensor has no hinge."""
    assert found(turned(made("rom_fist"), "hand", quat.about(0, QUARTER))) == []


@pytest.mark.parametrize("finger", ["index", "little"])
@pytest.mark.parametrize("task", ["rom_fist", "tapping"])
def test_the_thumbs_strip_exchanged_with_a_fingers_is_named_once_for_each(
    finger: str, task: str
) -> None:
    findings = found(exchanged(made(task, seed=1), "thumb", finger))
    assert {f.sensor for f in findings} == {*CHAINS["thumb"], *CHAINS[finger]}
    assert {f.kind for f in findings} == {"swapped"}
    assert (
        f"the strips of the thumb and the {finger} finger seem to be exchanged"
        in findings[0].sentence
    )


@pytest.mark.parametrize(
    ("one", "other"), [("index", "middle"), ("index", "little"), ("ring", "little")]
)
def test_two_fingers_strips_exchanged_are_named_where_one_finger_after_the_other_bent(
    one: str, other: str
) -> None:
    findings = found(exchanged(made("wiggle", "right"), one, other))
    assert {f.sensor for f in findings} == {*CHAINS[one], *CHAINS[other]}
    assert f"exchange the strips of {one} and {other}" in findings[0].fix


def test_three_strips_exchanged_in_a_ring_are_told_by_the_order_they_bent_in() -> None:
    findings = found(exchanged(exchanged(made("wiggle"), "index", "middle"), "middle", "ring"))
    assert {f.severity for f in findings} == {"warning"}
    assert "bent in the order thumb," in findings[0].sentence


def test_another_fingers_strip_that_taps_is_the_indexs() -> None:
    findings = found(exchanged(made("tapping"), "index", "ring"))
    assert {f.sensor for f in findings} == {*CHAINS["index"], *CHAINS["ring"]}


@pytest.mark.parametrize(
    ("task", "one", "other"),
    [
        ("powerglove_10_index_fast", "index", "middle"),
        ("powerglove_06_middle_all", "middle", "little"),
    ],
)
def test_another_fingers_strip_that_moves_is_that_of_the_finger_the_task_is_named_after(
    task: str, one: str, other: str
) -> None:
    findings = found(exchanged(made(task, seed=2), one, other))
    assert {f.sensor for f in findings} == {*CHAINS[one], *CHAINS[other]}
    assert found(made(task, seed=2)) == []


def test_two_fingers_exchanged_in_a_fist_are_not_seen() -> None:
    """A limit that the module's header names."""
    assert found(exchanged(made("rom_fist"), "index", "ring")) == []


@pytest.mark.parametrize(
    ("column", "words"), [(0, "x axis of its gyroscope"), (5, "z axis of its accelerometer")]
)
@pytest.mark.parametrize("corrected", [False, True])
def test_a_dead_axis_is_named_also_behind_a_strips_correction(
    column: int, words: str, corrected: bool
) -> None:
    correction = ImuCalibration(
        {q: np.eye(3) + 0.02 * np.random.default_rng(3).normal(size=(3, 3)) for q in (GYR, ACC)}
    )

    def kill(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("index_middle"), column] = 0.0
        if corrected:
            values[:, [names.index("index_middle")]] = apply(
                [correction], (GYR, ACC), values[:, [names.index("index_middle")]]
            )

    dead = [f for f in found(changed(made("rom_fist"), kill)) if f.kind == "dead_axis"]
    assert [f.sensor for f in dead] == ["index_middle"]
    assert words in dead[0].sentence


def test_a_sensor_that_repeats_its_last_reading_is_named_with_the_time() -> None:
    def freeze(values: Array, names: tuple[str, ...]) -> None:
        values[900:1500, names.index("little_distal")] = values[899, names.index("little_distal")]

    (finding,) = found(changed(made("rom_fist"), freeze))
    assert (finding.sensor, finding.kind) == ("little_distal", "stuck")
    assert "gyroscope and accelerometer gave one and the same reading" in finding.sentence
    assert finding.spans[0] == pytest.approx((9.0, 15.0), abs=1.01)


def test_a_sensor_that_stood_still_is_flagged_meanwhile_and_its_heading_is_lost_afterwards() -> (
    None
):
    def freeze(values: Array, names: tuple[str, ...]) -> None:
        values[900:1500, names.index("little_distal")] = values[899, names.index("little_distal")]

    moved = process(m2, m2.Params(), changed(made("rom_fist"), freeze)).trajectory
    flags = moved.flags[:, SEGMENT["little_distal"]]
    assert ((flags & Flag.FAULTY) != 0)[(moved.t > 10.1) & (moved.t < 14.0)].all()
    assert not ((flags & Flag.FAULTY) != 0)[moved.t > 16.1].any()
    assert ((flags & Flag.HEADING_LOST) != 0)[moved.t > 10.1].all()
    assert not flags[moved.t < 7.9].any()


def test_a_stuck_magnetometer_is_named() -> None:
    def stick(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("ring_distal")] = values[0, names.index("ring_distal")]

    (finding,) = found(changed(made("rom_fist", magnetic=True), stick, "mag"))
    assert (finding.sensor, finding.kind) == ("ring_distal", "magnetometer")


def test_a_magnet_nearby_is_named() -> None:
    def magnetize(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("hand")] += 200e-6

    (finding,) = found(changed(made("rom_fist", magnetic=True), magnetize, "mag"))
    assert (finding.sensor, finding.kind, finding.severity) == ("hand", "magnetometer", "warning")


@pytest.mark.parametrize("known", [True, False])
def test_clipping_is_named_with_and_without_a_known_full_scale(known: bool) -> None:
    recording, limit = made("tapping"), 5.0
    block = recording.samples["imu"]
    values = block.values.copy()
    k = block.stream.sensors.index("index_distal")
    assert np.abs(values[..., k, :3]).max() > limit
    values[:, k, :3] = np.clip(values[:, k, :3], -limit, limit)
    stream = replace(block.stream, full_scale={GYR: limit} if known else {})
    others = [i for i in range(values.shape[1]) if i != k]
    values[:, others, :3] = (
        np.clip(values[:, others, :3], -0.9 * limit, 0.9 * limit)
        if known
        else values[:, others, :3]
    )
    findings = found(replace(recording, samples={"imu": Block(stream, block.t, values)}))
    assert [(f.sensor, f.kind) for f in findings] == [("index_distal", "saturated")]
    assert not any("rest" in f.sentence for f in findings)


@pytest.mark.parametrize(("off", "severity"), [(0.7, "warning"), (1.5, "fault")])
def test_an_accelerometer_far_from_g_at_rest_is_named(off: float, severity: str) -> None:
    def stretch(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("index_middle"), 3:] *= 1 + off / 9.81

    (finding,) = found(changed(made("rom_fist"), stretch))
    assert (finding.sensor, finding.kind, finding.severity) == ("index_middle", "gravity", severity)


def test_a_gyroscope_with_an_impossible_bias_is_named() -> None:
    def shift(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("index_middle"), 1] += np.radians(15.0)

    (finding,) = found(changed(made("rom_fist"), shift))
    assert (finding.sensor, finding.kind, finding.severity) == ("index_middle", "bias", "warning")


def test_a_faulty_sensors_segment_is_flagged_and_told_and_no_other() -> None:
    recording = turned(made("rom_fist"), "ring_middle", quat.about(2, QUARTER))
    done = process(m2, m2.Params(), recording)
    assert [f.kind for f in done.findings] == ["turned"]
    assert done.findings[0].message in done.warnings
    assert "ring_middle: faulty sensor in 100.0 % of the samples" in done.warnings
    flagged = ((done.trajectory.flags & Flag.FAULTY) != 0).all(axis=0)
    assert list(np.flatnonzero(flagged)) == [SEGMENT["ring_middle"]]


def test_a_faulty_sensors_finger_is_doubtful_where_the_filter_couples_its_sensors() -> None:
    recording = turned(made("rom_fist"), "ring_middle", quat.about(2, QUARTER))
    flags = process(ekf, ekf.Params(), recording).trajectory.flags
    doubtful = ((flags & Flag.DOUBTFUL) != 0).all(axis=0)
    assert list(np.flatnonzero(doubtful)) == [SEGMENT[s] for s in CHAINS["ring"]]
    assert ((flags & Flag.FAULTY) != 0).any(axis=0).sum() == 1


def test_a_stuck_magnetometer_is_flagged_only_where_it_is_used() -> None:
    recording = made("rom_fist", magnetic=True)
    values = recording.samples["mag"].values.copy()
    values[:, SEGMENT["ring_distal"]] = values[0, SEGMENT["ring_distal"]]
    mag = recording.samples["mag"]
    assert (
        mag.stream.quantities == (MAG,)
        and mag.stream.sensors[SEGMENT["ring_distal"]] == "ring_distal"
    )
    recording = replace(
        recording, samples={**recording.samples, "mag": Block(mag.stream, mag.t, values)}
    )
    for method, used in ((b, True), (m2, False)):
        flags = process(method, method.Params(), recording).trajectory.flags
        assert ((flags[:, SEGMENT["ring_distal"]] & Flag.FAULTY) != 0).any() == used


def test_gravity_far_off_is_told_once() -> None:
    def stretch(values: Array, names: tuple[str, ...]) -> None:
        values[:, names.index("index_middle"), 3:] *= 1.2

    warnings = process(m2, m2.Params(), changed(made("rom_fist"), stretch)).warnings
    assert sum("resting accelerometer" in w for w in warnings) == 1
