"""Sensors against each other: each fault is named with its sensors, an intact recording is not."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.neighbours import check_neighbours as neighbours
from handscope.estimators.fault_detection.neighbours import exchanges, gains
from handscope.estimators.fault_detection.neighbours.unexplained import Unexplained
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.recording_checks.check import suspicions_of
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.studies import crosschecks, false_alarms, injected_faults, silent_faults
from tests.estimators.fault_detection.joint_recordings import (
    amplified,
    delayed,
    exchanged,
    freely_moved,
    knocked,
    loosened,
    slipped,
)
from tests.schedule import swept

GEOMETRY = sized("left")


def told(
    blocks: list[Block], hand: Hand = "left", geometry: HandGeometry = GEOMETRY
) -> list[Suspicion]:
    found = neighbours.check(blocks, hand, geometry, {}, [], [])
    return [s for s in found if s.message.severity != "info"]


def intact() -> list[Block]:
    return list(freely_moved().blocks())


def test_an_intact_recording_is_not_suspected() -> None:
    assert told(intact()) == []


@pytest.mark.parametrize("percent", [11.0, -9.0])
def test_a_rate_that_the_file_tells_wrong_is_told_by_the_joints(percent: float) -> None:
    (found,) = told(injected_faults.change_clock_rate(intact(), percent))
    assert (found.message.code, found.message.severity) == ("file.rate", "fault")
    assert found.correction is not None
    assert found.correction["rate"] == pytest.approx(1 + percent / 100, abs=0.01)


def test_a_wrong_rate_is_told_where_few_windows_tell_it_but_nearly_every_joint_does() -> None:
    made, _ = silent_faults.recorded("fast fist", 9002)
    spoilt, _ = silent_faults.FAULTS["rate 100 told as 90"]
    (found,) = suspicions_of(spoilt(made, silent_faults.Choice("index", 1, 0, 12.0)).declared())
    assert (found.message.code, found.message.severity) == ("file.rate", "fault")
    assert found.correction is not None
    assert found.correction["rate"] == pytest.approx(1 / 0.9, abs=0.02)


def test_larger_rates_do_not_explain_noise_of_accelerometers() -> None:
    """More skin movement is expected of them, too."""
    rng, blocks = np.random.default_rng(5), []
    for block in intact():
        values, axes = block.values.copy(), block.stream.axes(ACC)
        values[..., axes] += rng.normal(0, 0.8, values[..., axes].shape)  # m/s^2
        blocks.append(replace(block, values=values))
    pairs = neighbours.prepare_pairs(blocks, sized("left"), {}, [])
    assert pairs is not None
    assert gains.find_common(pairs)[1] > neighbours.FALSE_ALARM


@pytest.mark.slow
@pytest.mark.parametrize(
    "pair",
    [
        ("index_middle", "index_distal"),
        ("ring_proximal", "ring_middle"),
        ("index_distal", "middle_distal"),
    ],
)
def test_two_exchanged_sensors_are_named_and_can_be_exchanged_back(pair: tuple[str, str]) -> None:
    (found,) = told(exchanged(freely_moved(), *pair))
    assert found.message.code == "sensors.exchanged"
    assert found.correction is not None and set(found.correction["exchange"]) == set(pair)  # type: ignore[call-overload]
    assert found.p_value < neighbours.FALSE_ALARM


@pytest.mark.parametrize("late", [0.2, -0.15])
def test_a_late_sensor_is_named_with_its_delay(late: float) -> None:
    (found,) = told(delayed(freely_moved(), ["middle_middle"], late))
    assert found.sensors == ("middle_middle",)
    assert found.message.code == ("sensors.late" if late > 0 else "sensors.early")
    assert found.correction is not None
    np.testing.assert_allclose(found.correction["delay"], late, atol=0.01)  # type: ignore[call-overload]


def test_a_late_strip_is_told_as_one() -> None:
    (found,) = told(delayed(freely_moved(), CHAINS["index"], 0.2))
    assert found.sensors == CHAINS["index"]


def test_a_gyroscope_that_reads_too_much_is_named_with_its_gain() -> None:
    (found,) = told(amplified(freely_moved(), "index_proximal", 1.3))
    assert (found.message.code, found.sensors) == ("sensor.gain_at_joints", ("index_proximal",))
    assert found.message.values["gain"] == pytest.approx(1.3, abs=0.03)
    assert found.correction is not None
    np.testing.assert_allclose(found.correction["gyr"], np.eye(3) / 1.3, atol=0.02)  # type: ignore[call-overload]


def test_sensors_that_do_not_meet_are_told_though_no_cause_explains_it() -> None:
    found = told(loosened(freely_moved(), "ring_middle"))
    assert {s.message.code for s in found} == {"sensors.disagree"}
    assert all("ring_middle" in s.sensors for s in found)


def test_a_gyroscope_that_reads_too_much_for_three_seconds_only_is_told() -> None:
    found = told(amplified(freely_moved(), "index_middle", 1.3, (10.0, 13.0)))
    assert {s.message.code for s in found} == {"sensors.disagree"}
    assert all("index_middle" in s.sensors for s in found)
    assert all(a > 9.0 and b < 14.0 for s in found for a, b in s.spans)  # windows of a second


def test_sensors_are_doubted_until_as_much_movement_shows_that_they_agree() -> None:
    """Of 24 s the last three, after a fault that ends at 20 s, do not show enough of it."""
    (found,) = told(amplified(freely_moved(), "index_distal", 1.4, (16.0, 20.0)))
    ((start, stop),) = found.spans
    assert 15.0 < start < 17.0
    assert float(found.message.values["stop"]) < 21.0
    assert stop == pytest.approx(float(intact()[0].t[-1]), abs=0.1)


@pytest.mark.parametrize("since", [-np.inf, 8.0])
def test_a_gyroscope_of_the_only_finger_that_moves_is_compared_with_what_other_joints_leave(
    since: float,
) -> None:
    """Its joints leave less than skin might, and far more than those of the other sensors."""
    rng = np.random.default_rng(8)
    tapping = simulate(("tapping",), "left", GEOMETRY, rng, SensorErrors())
    assert told(list(tapping.blocks())) == []
    found = told(amplified(tapping, "index_distal", 1.3, (since, np.inf)))
    assert [(s.message.code, s.sensors) for s in found] == [
        ("sensors.disagree", ("index_middle", "index_distal"))
    ]
    ((start, _),) = found[0].spans
    assert start >= since - 1.0


def test_joints_of_a_struck_finger_that_no_single_sensor_explains_are_no_faults() -> None:
    def odd(p_value: float, *joints: tuple[str, str]) -> list[Unexplained]:
        return [Unexplained(j, 40.0, p_value, (0.0, 9.0), (0.0, 9.0)) for j in joints]

    p, m, d = CHAINS["middle"]
    every = ("hand", p), (p, m), (m, d)
    ring = odd(1e-5, ("hand", CHAINS["ring"][0]))
    assert neighbours.by_single_sensors([*odd(1e-6, *every), *ring]) == ring
    assert neighbours.by_single_sensors(odd(1e-6, *every[:2])) == odd(1e-6, *every[:2])
    assert neighbours.by_single_sensors(odd(1e-12, *every)) == odd(1e-12, *every)


def test_a_knock_in_a_single_second_is_no_fault() -> None:
    tapping = simulate(("tapping",), "left", GEOMETRY, np.random.default_rng(8), SensorErrors())
    assert told(knocked(tapping, "index_distal", 10.2)) == []


def with_exchanged_fingers(recording: Simulated, one: str, other: str) -> list[Block]:
    for a, b in zip(CHAINS[one], CHAINS[other]):
        blocks = exchanged(recording, a, b)
        recording = replace(recording, samples={block.stream.name: block for block in blocks})
    return blocks


@pytest.mark.parametrize(
    "pair",
    swept([("index", "ring"), ("index", "middle"), ("ring", "little")], [("index", "middle")]),
)
def test_two_exchanged_fingers_are_named(pair: tuple[str, str]) -> None:
    (found,) = told(with_exchanged_fingers(freely_moved(), *pair))
    assert found.message.code == "fingers.exchanged"
    assert (found.message.values["first"], found.message.values["second"]) == pair


def test_exchanged_fingers_are_found_in_a_hand_that_the_forearm_turns_while_they_rest() -> None:
    turned = simulate(
        ("pronation_supination",), "left", GEOMETRY, np.random.default_rng(8), SensorErrors()
    )
    assert told(list(turned.blocks())) == []
    found = told(with_exchanged_fingers(turned, "middle", "ring"))
    assert [s.message.code for s in found] == ["fingers.exchanged"]


@pytest.mark.parametrize(
    ("order", "moved"),
    [
        pytest.param(  # one further, each
            ("middle", "ring", "little", "index"),
            "index, middle, ring, little",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            ("little", "ring", "middle", "index"),
            "index, middle, ring, little",
            marks=pytest.mark.slow,
        ),
        (("middle", "ring", "index", "little"), "index, middle, ring"),
    ],
)
def test_several_strips_on_other_fingers_are_all_named(order: Sequence[str], moved: str) -> None:
    made, _ = silent_faults.recorded("free", 9002)
    on = list(FINGERS[1:])
    for k, finger in enumerate(FINGERS[1:]):
        if (other := on.index(order[k])) != k:
            swapped = list(zip(CHAINS[finger], CHAINS[FINGERS[1:][other]]))
            made = crosschecks.exchange(swapped, made)
            on[k], on[other] = on[other], on[k]
    (found,) = suspicions_of(made.declared())
    assert (found.message.code, found.message.values["fingers"]) == (
        "fingers.several_exchanged",
        moved,
    )
    assert found.correction is None
    assert {s.partition("_")[0] for s in found.sensors} == set(moved.split(", "))


def test_a_slipped_sensor_is_named_with_its_turn_and_time() -> None:
    (found,) = told(slipped(freely_moved(), "middle_middle", 17.0, 12.3))
    assert (found.message.code, found.sensors) == ("sensor.slipped", ("middle_middle",))
    assert found.message.values["angle_deg"] == pytest.approx(17.0, abs=3.0)
    assert found.spans[0][0] == pytest.approx(12.3, abs=0.1)


def gapped(blocks: list[Block]) -> list[Block]:
    """Of every second 0.08 s are lost, so that no window is whole."""
    return [replace(b, t=b.t[(kept := b.t % 1.0 < 0.92)], values=b.values[kept]) for b in blocks]


@pytest.mark.parametrize("sensor", swept(["middle_middle", "ring_proximal"], ["ring_proximal"]))
@pytest.mark.parametrize(("losses", "seconds"), [(list, 0.2), (list, 0.1), (gapped, 0.1)])
def test_a_sensor_that_its_gyroscope_saw_turn_on_its_segment_is_named(
    sensor: str, losses: Callable[[list[Block]], list[Block]], seconds: float
) -> None:
    turn = np.array([0.0, 0.0, np.radians(17.0)])
    turning = crosschecks.slipped(sensor, turn, 12.3, seconds=seconds)
    (found,) = told(losses([turning(b) for b in intact()]))
    assert (found.message.code, found.sensors) == ("sensor.slipped", (sensor,))
    assert found.message.values["angle_deg"] == pytest.approx(17.0, rel=0.3)
    assert found.spans[0][0] == pytest.approx(12.3, abs=0.05)
    assert found.correction is None  # later readings are right in a frame that turned with them


@pytest.mark.parametrize(
    ("movement", "sensor"),
    [
        pytest.param("opposing", "index_middle", marks=pytest.mark.slow),
        pytest.param("slow fist", "index_distal", marks=pytest.mark.slow),
        ("fast fist", "index_distal"),
    ],
)
def test_a_turn_that_a_gyroscope_saw_is_named_in_the_simulator_that_is_not_ours(
    movement: str, sensor: str
) -> None:
    made, _ = silent_faults.recorded(movement, 9002)
    assert suspicions_of(made.declared()) == []
    spoilt = crosschecks.slip(made, 17.0, sensor, 14.0, 0.2)
    (found,) = suspicions_of(spoilt.declared())
    assert (found.message.code, found.sensors) == ("sensor.slipped", (sensor,))
    assert found.message.values["angle_deg"] == pytest.approx(17.0, abs=2.0)
    assert found.spans[0][0] == pytest.approx(14.0, abs=0.05)


def test_a_turn_is_named_of_a_finger_that_rests_in_a_hand_that_rests() -> None:
    """Nothing but the turn itself tells where the joints lie, and accelerometers' biases have to be learnt beside it."""
    made, _ = silent_faults.recorded("tapping", 9001)
    spoilt = crosschecks.slip(made, 17.0, "ring_middle", 14.0, 0.2)
    (found,) = suspicions_of(spoilt.declared())
    assert (found.message.code, found.sensors) == ("sensor.slipped", ("ring_middle",))
    assert found.message.values["angle_deg"] == pytest.approx(17.0, abs=2.0)


def test_a_sensor_that_its_gyroscope_did_not_see_turn_is_not_said_to_have_turned_so() -> None:
    """Somebody's hand in the pose: small accelerations fit a segment that turns back by what its sensor turned on it."""
    resting = false_alarms._record(false_alarms.Trial("outside: resting", 15816))
    assert [s for s in suspicions_of(resting) if s.message.severity != "info"] == []


def test_gaps_of_a_sensor_are_no_disagreement() -> None:
    fist = simulate(
        ("rom_fist", "tapping"), "left", GEOMETRY, np.random.default_rng(8), SensorErrors()
    )

    def drop(block: Block) -> Block:
        values = block.values.copy()
        values[np.mod(block.t, 1.2) < 0.3, block.stream.sensors.index("index_middle")] = np.nan
        return replace(block, values=values)

    assert told([drop(b) for b in fist.blocks()]) == []


def test_the_other_hand_is_told_by_its_bones() -> None:
    other = replace(
        GEOMETRY,
        hand="right",
        joint_positions={j: tuple(-x for x in p) for j, p in GEOMETRY.joint_positions.items()},
    )
    (found,) = told(intact(), "right", other)
    assert found.message.code == "hand.other"


@cache
def turned_about() -> Simulated:
    """A wrist that bends and stretches while the fingers stay as they are in the pose."""
    return simulate(
        ["initial_pose", "rom_wrist_flexion"],
        "left",
        GEOMETRY,
        np.random.default_rng(8),
        SensorErrors(),
        segments=tuple(s for s in SEGMENTS if s != "forearm"),
        rate=100.0,
    )


def with_noise(block: Block, sd: float, rng: np.random.Generator) -> Block:
    """White noise (m/s^2) more on accelerations."""
    values = block.values.copy()
    values[..., block.stream.axes(ACC)] += sd * rng.standard_normal((*values.shape[:2], 3))
    return replace(block, values=values)


@pytest.mark.parametrize(
    "pair",
    swept(
        [("ring_middle", "ring_distal"), ("index_proximal", "index_middle")],
        [("ring_middle", "ring_distal")],
    ),
)
@pytest.mark.parametrize("noise", [0.0, 0.1])  # m/s^2; with it distances are known to 7 mm only
def test_sensors_of_a_finger_that_does_not_bend_are_told_apart_by_their_distances(
    pair: tuple[str, str], noise: float
) -> None:
    pairs = neighbours.prepare_pairs(list(turned_about().blocks()), GEOMETRY, {}, [])
    assert pairs is not None and exchanges.find_by_distances(pairs) is None
    rng = np.random.default_rng(3)
    (found,) = told([with_noise(b, noise, rng) for b in exchanged(turned_about(), *pair)])
    assert found.message.code == "sensors.exchanged"
    assert found.sensors == pair  # from the hand outwards
    assert found.correction == {"exchange": pair}


@pytest.mark.parametrize(
    "rattling", swept([None, "thumb_proximal", "ring_middle"], [None, "thumb_proximal"])
)
def test_mirrored_knuckles_are_told(rattling: str | None) -> None:
    """Whatever is wrong with one finger; of the other hand's thumb much seems to be."""
    mirrored = replace(
        GEOMETRY,
        joint_positions={j: (x, y, -z) for j, (x, y, z) in GEOMETRY.joint_positions.items()},
    )
    blocks = intact() if rattling is None else loosened(freely_moved(), rattling)
    found = told(blocks, "left", mirrored)
    assert "hand.mirrored" in [s.message.code for s in found]
    assert rattling != "thumb_proximal" or len(found) == 1


def test_joint_places_of_the_other_hand_are_told_without_any_movement() -> None:
    other = replace(
        GEOMETRY,
        joint_positions={j: tuple(-x for x in p) for j, p in GEOMETRY.joint_positions.items()},
    )
    (found,) = told([b.between(0.0, 1.0) for b in intact()], "left", other)
    assert found.message.code == "geometry.impossible"


def without_accelerations(seed: int) -> list[Block]:
    """A fist that opens and closes, whose accelerometers show gravity alone, as simple simulations of a glove have it."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 20.0, 0.01)
    sensors = ("hand", *CHAINS["index"], *CHAINS["middle"], *CHAINS["ring"])
    values = rng.normal(size=(len(t), len(sensors), 6)) * [*[0.002] * 3, *[0.02] * 3]
    for k in range(1, len(sensors)):
        most = np.radians((60.0, 140.0, 185.0)[(k - 1) % 3]) * (1 + 0.2 * rng.normal())
        angle = most * (1 - np.cos(np.pi * t)) / 2
        values[:, k, 2] += most * np.pi * np.sin(np.pi * t) / 2
        values[:, k, 3:5] += 9.81 * np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    values[:, 0, 3] += 9.81
    return [Block(Stream("imu", sensors, (GYR, ACC), 100.0), t, values)]


@pytest.mark.parametrize("seed", swept([0, 2], [0]))
def test_a_glove_without_accelerations_of_its_movement_is_not_suspected(seed: int) -> None:
    assert told(without_accelerations(seed)) == []


def test_a_resting_hand_tells_nothing_whatever_is_exchanged() -> None:
    resting = [
        b.between(0.0, 1.4) for b in exchanged(freely_moved(), "index_middle", "index_distal")
    ]
    assert told(resting) == []


def test_nothing_and_one_sensor_are_no_error() -> None:
    assert told([]) == []
    block = intact()[0]
    one = Block(replace(block.stream, sensors=("hand",)), block.t, block.values[:, :1])
    assert told([one]) == []


@pytest.mark.parametrize("person", swept([10301, 12328], [12328]))
def test_a_forearm_that_turns_about_a_finger_tells_no_length_of_its_bones(person: int) -> None:
    """Its joints stay where they are: gravity alone, which tells no heading."""
    assert suspicions_of(crosschecks.recorded("forearm turned", person).declared()) == []
