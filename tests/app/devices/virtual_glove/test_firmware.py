"""The virtual glove's inside, driven with a clock that is passed in: what comes out is decoded by the code that decodes a real glove."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.devices.virtual_glove.faults import FaultParams, Faults
from handscope.app.devices.virtual_glove.firmware import Build, Firmware
from handscope.app.devices.virtual_glove.wearer import Playback, SimulatedPerson, layout
from handscope.estimators.data.samples import ACC, FORCE, TORQUE, Block, join
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions import motion_bids
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder
from tests.simulated import pose_and_wiggle

ALL = (*FINGERS, "forearm")


def person(
    strips: tuple[str, ...] = ALL, rate: float = 100.0, errors: SensorErrors | None = None
) -> SimulatedPerson:
    return SimulatedPerson(
        "left",
        sized("left"),
        layout(strips, rate),
        np.random.default_rng(3),
        errors or SensorErrors(),
    )


def glove(wearer: SimulatedPerson | Playback, **build: object) -> Firmware:
    return Firmware(wearer, replace(Build(), **build), np.random.default_rng(4))  # type: ignore[arg-type]


def play(
    firmware: Firmware,
    seconds: float,
    assembler: Assembler | None = None,
    change: Callable[[list[bytes], float], bytes] = lambda frames, t: b"".join(frames),
) -> dict[str, Block]:
    """Let the glove run in steps of 4 ms; whole streams by name. `change` stands between glove and host."""
    assembler = assembler or Assembler()
    found: dict[str, list[Block]] = {}
    received = firmware.handle(Encoder().frame(wire.Start()))
    for k in range(round(seconds / 0.004)):
        received += change(firmware.advance(0.004), 0.004 * k)
        for block in assembler.feed(received, 50.0 + 0.004 * k):
            found.setdefault(block.stream.name, []).append(block)
        received = b""
    return {name: join(blocks) for name, blocks in found.items()}


def test_a_glove_with_all_strips_sends_every_sample_of_17_sensors_once() -> None:
    assembler = Assembler()
    streams = play(glove(person()), 3.0, assembler)
    assert sum(len(b.stream.sensors) for b in streams.values()) == 17
    for name, block in streams.items():
        settled = block.t[
            block.t > 1.0
        ]  # the forearm's clock is mapped as its least delayed bursts come in, the others are exact
        np.testing.assert_allclose(
            np.diff(settled), 0.01, atol=1e-3 if name == "forearm" else 1e-9, err_msg=name
        )
        assert len(block.t) >= 290
        assert np.isfinite(block.values).all()
    assert assembler.counters.lost == assembler.counters.corrupt == 0
    assert sum(c.lost for c in assembler.counts.values()) == 0


@pytest.mark.parametrize(("build", "is_behind"), [({}, True), ({"forearm_delay": (0, 0)}, False)])
def test_a_forearms_samples_wait_for_the_radio_and_on_a_cable_for_nothing(
    build: dict[str, object], is_behind: bool
) -> None:
    firmware, assembler, received = (
        glove(person(("forearm",)), **build),
        Assembler(),
        Counter[str](),
    )
    firmware.handle(Encoder().frame(wire.Start()))
    behind = []
    for k in range(1000):
        for block in assembler.feed(b"".join(firmware.advance(0.001)), 50.0 + 0.001 * k):
            received[block.stream.name] += len(block.t)
        behind.append(received["hand"] - received["forearm"])
    assert received["hand"] > 90
    assert any(behind) is is_behind and min(behind) >= 0


@pytest.mark.parametrize("rate", [1.0, 60.0, 1000.0])
def test_rates_from_1_to_1000_hz_are_kept(rate: float) -> None:
    streams = play(glove(person(("index",), rate)), 2.5)
    for block in streams.values():
        assert block.stream.rate == rate
        assert len(block.t) == pytest.approx(2.5 * rate, abs=0.02 * rate + 1)


def test_strips_may_have_rates_of_their_own() -> None:
    wearer = person(("thumb", "index"))
    wearer.streams = tuple(
        replace(s, rate=500.0) if s.name == "index" else s for s in wearer.streams
    )
    streams = play(glove(wearer), 1.0)
    assert {name: b.stream.rate for name, b in streams.items()} == {
        "hand": 100.0,
        "thumb": 100.0,
        "index": 500.0,
    }
    assert len(streams["index"].t) == pytest.approx(500, abs=15)


def test_force_sensors_come_at_their_own_rate_with_their_limit() -> None:
    streams = play(glove(person(("thumb", "index", "force"))), 2.0)
    (force,) = (b for b in streams.values() if FORCE in b.stream.quantities)
    assert force.stream.sensors == ("thumb_tip_force", "index_tip_force")
    assert (force.stream.rate, force.stream.full_scale[FORCE]) == pytest.approx((12.0, 30.0))
    assert len(force.t) >= 22
    assert np.abs(force.of(FORCE)).max() < 1.5  # a zero of some tenths, nothing touched
    assert len(np.unique(force.of(FORCE))) > 60


def test_torques_go_from_the_wire_into_a_recording_into_a_file_and_back_through_another_glove(
    tmp_path: Path,
) -> None:
    """Of a sensor with six axes; played again they come in a stream of their own, and read the same."""
    firmware = glove(person(("thumb", "index", "force", "torque")), format=wire.Format.FLOAT32)
    with Recorder(tmp_path / "a.mcap", {"hand": "left"}, 0.0) as recorder:
        recorder.write(firmware.handle(Encoder().frame(wire.Start())), 0.0)
        for k in range(400):
            recorder.write(b"".join(firmware.advance(0.004)), 0.004 * k)
    kept = native.load(tmp_path / "a.mcap")
    motion_bids.write(kept, tmp_path / "b.zip")
    read = motion_bids.load(tmp_path / "b.zip")
    (force, again) = (
        next(b for b in r.samples.values() if FORCE in b.stream.quantities) for r in (kept, read)
    )
    assert force.stream.quantities == (FORCE, TORQUE)
    assert force.stream.full_scale[TORQUE] == pytest.approx(0.15)
    assert 1e-5 < np.abs(force.of(TORQUE)).max() < 0.01  # a zero of some mNm, nothing touched
    np.testing.assert_array_equal(again.values, force.values)
    played = play(glove(Playback(read), format=wire.Format.FLOAT32), 1.2)
    for point in force.stream.sensors:
        (one,) = (
            b
            for b in played.values()
            if b.stream.sensors == (point,) and b.stream.quantities == (TORQUE,)
        )
        np.testing.assert_array_equal(
            one.of(TORQUE)[:12, 0], force.of(TORQUE)[:12, force.stream.sensors.index(point)]
        )


def test_a_force_strip_needs_the_fingers_that_it_sits_on_and_torques_need_it() -> None:
    with pytest.raises(InputError, match="tips of thumb and index finger"):
        layout(("index", "force"), 100.0)
    with pytest.raises(InputError, match="plug in the strip 'force'"):
        layout(("thumb", "index", "torque"), 100.0)


def test_a_resting_wearer_reads_gravity_in_every_sensor() -> None:
    streams = play(glove(person(errors=SensorErrors(acc_bias=0.0))), 1.0)
    for block in streams.values():
        np.testing.assert_allclose(np.linalg.norm(block.of(ACC), axis=-1), 9.80665, atol=0.15)


def test_a_pulled_strip_falls_silent_and_comes_back_on_the_same_clock() -> None:
    firmware, assembler = glove(person(("index",))), Assembler()
    before = play(firmware, 1.0, assembler)
    assembler.feed(firmware.pull("index"), 51.0)
    gone = play(firmware, 1.0, assembler)
    assert "index" not in gone
    assert "index" not in {s.name for s in assembler.streams.values()}
    assembler.feed(firmware.plug("index"), 52.0)
    back = play(firmware, 1.0, assembler)
    assert before["index"].t[-1] < 1.01
    assert 1.99 < back["index"].t[0] < 2.6
    np.testing.assert_allclose(np.diff(back["hand"].t), 0.01, atol=1e-9)


def test_a_cue_makes_the_wearer_move_and_an_unknown_one_is_refused() -> None:
    firmware, assembler = glove(person(("index",))), Assembler()
    still = play(firmware, 1.0, assembler)
    firmware.handle(Encoder().frame(wire.Cue("tapping", {"duration": "5"})))
    moving = play(firmware, 4.0, assembler)
    assert np.abs(still["index"].of("gyr")).max() < 0.1
    assert np.abs(moving["index"].of("gyr")).max() > 3.0
    assembler.feed(firmware.handle(Encoder().frame(wire.Cue("juggling"))), 60.0)
    assert assembler.replies[-1].code is wire.ReplyCode.BAD_ARGUMENT


def test_configure_changes_rates_only_while_stopped() -> None:
    firmware, assembler, send = glove(person(("index",))), Assembler(), Encoder()
    assembler.feed(firmware.handle(send.frame(wire.Configure(rate=250.0))), 0.0)
    assert assembler.replies[-1].code is wire.ReplyCode.OK
    assert {s.rate for s in assembler.streams.values()} == {250.0}
    assembler.feed(firmware.handle(send.frame(wire.Start())), 0.1)
    assembler.feed(firmware.handle(send.frame(wire.Configure(rate=100.0))), 0.2)
    assert assembler.replies[-1].code is wire.ReplyCode.BUSY
    firmware.power_off()
    assembler.feed(firmware.handle(send.frame(wire.Configure(rate=5000.0))), 0.3)
    assert assembler.replies[-1].code is wire.ReplyCode.BAD_ARGUMENT


def test_a_recording_played_back_arrives_with_its_numbers_times_and_events() -> None:
    made = pose_and_wiggle("right")
    recording = LoadedRecording(
        made.hand,
        made.geometry,
        {"index_middle": np.array([0.6, 0.8, 0, 0])},
        made.samples,
        made.events,
    )
    assembler = Assembler()
    streams = play(
        glove(Playback(recording), format=wire.Format.FLOAT32), recording.duration + 0.3, assembler
    )
    assert assembler.identity is not None
    assert assembler.identity.hand == "right"
    for name, block in streams.items():
        whole = recording.samples["forearm" if name == "forearm" else "imu"]
        rows = [whole.stream.sensors.index(s) for s in block.stream.sensors]
        np.testing.assert_allclose(block.t, whole.t, atol=2e-9)
        np.testing.assert_array_equal(
            block.values, whole.values[:, rows].astype("<f4").astype(float)
        )
    assert [(e.trial_type, e.details) for e in assembler.marks] == [
        (e.trial_type, dict(e.details)) for e in recording.events
    ]
    np.testing.assert_allclose(
        [e.onset for e in assembler.marks], [e.onset for e in recording.events], atol=1e-9
    )
    np.testing.assert_allclose(assembler.mounting["index_middle"], [0.6, 0.8, 0, 0], atol=1e-7)


@pytest.mark.parametrize(
    ("fault", "counted"),
    [
        ("loss", "lost"),
        ("corrupt", "corrupt"),
        ("repeat", "repeated"),
        ("garbage", "garbage_bytes"),
    ],
)
def test_faults_are_counted_and_do_no_more_harm_than_they_must(fault: str, counted: str) -> None:
    faults = Faults(FaultParams(**{fault: 0.1}), np.random.default_rng(8))
    assembler = Assembler()
    streams = play(glove(person(("index",))), 5.0, assembler, faults.pass_on)
    assert getattr(assembler.counters, counted) > 20
    share = len(streams["hand"].t) / 500
    assert share > 0.75
    if fault == "repeat":
        np.testing.assert_allclose(np.diff(streams["hand"].t), 0.01, atol=1e-9)
        assert share > 0.98


def test_held_up_bursts_change_no_time_stamp() -> None:
    faults = Faults(FaultParams(delay=0.8), np.random.default_rng(8))
    streams = play(glove(person(("index",))), 7.0, None, faults.pass_on)
    np.testing.assert_allclose(np.diff(streams["index"].t), 0.01, atol=1e-9)


def test_saturation_clips_at_the_full_scale_that_the_glove_tells() -> None:
    wearer = person(("index",), errors=SensorErrors(gyr_range=60.0, gyr_bias=0.0))
    limit = np.radians(60.0)
    wearer.streams = tuple(
        replace(s, full_scale={**s.full_scale, "gyr": limit}) for s in wearer.streams
    )
    firmware, assembler = glove(wearer), Assembler()
    firmware.handle(Encoder().frame(wire.Start()))
    firmware.handle(Encoder().frame(wire.Cue("tapping", {"duration": "5"})))
    streams = play(firmware, 5.0, assembler)
    assert np.abs(streams["index"].of("gyr")).max() <= limit * 1.001
    assert assembler.counts["index"].saturated > 50
    assert assembler.counts["hand"].saturated == 0


def test_an_unknown_strip_is_refused_with_the_list_of_strips() -> None:
    with pytest.raises(InputError, match="unknown strip 'toe'; strips are forearm, thumb, index"):
        layout(("index", "toe"), 100.0)
