"""The virtual strips' own errors, the calibrations in their flash that remove them, and others written over a real port."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.devices import strip_flash
from handscope.app.devices.virtual_glove.firmware import Build, Firmware
from handscope.app.devices.virtual_glove.flash import Flash, factory_flash, require_fitting
from handscope.app.devices.virtual_glove.wearer import SimulatedPerson, layout
from handscope.estimators.data.samples import ACC, FORCE, GYR, Block, Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import ForceCalibration
from handscope.estimators.force.setup import ForceSetup
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.imu_calibration import CALIBRATED, ImuCalibration
from handscope.estimators.simulation.sensors import IDEAL
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Decoder, Encoder
from handscope.sessions.wire.strip_calibration import message_of
from tests.app.devices.virtual import virtual_glove
from tests.app.devices.virtual_glove.test_firmware import person, play
from tests.estimators.sensors.test_imu_calibration import drawn
from tests.laid_down import laid_down, many_positions

BENCH = (
    Stream(
        "index",
        ("index_proximal", "index_middle", "index_distal"),
        (GYR, ACC),
        100.0,
        "base",
        {GYR: 40.0, ACC: 160.0},
    ),
)


@dataclass
class OnTheBench:
    """A strip laid down in many positions; a wearer of the virtual glove."""

    hand: str = "left"
    streams: tuple[Stream, ...] = BENCH
    mounting: dict[str, Array] = field(default_factory=dict)
    plate: None = None

    def __post_init__(self) -> None:
        r = laid_down(many_positions(6), 6, IDEAL)
        self._whole = Block(
            BENCH[0], r.t, np.concatenate([r.gyr, r.acc], axis=1)[:, None].repeat(3, axis=1)
        )
        self.duration = float(r.t[-1])

    def samples(self, stream: Stream, start: float, stop: float) -> Block:
        return self._whole.between(start, stop)

    def cue(self, task: str, details: object, t: float) -> bool:
        return False

    def marks(self, start: float, stop: float) -> list[Event]:
        return []


def flashed(seed: int = 1) -> Flash:
    return factory_flash(person().streams, np.random.default_rng(seed))


def powered(flash: Flash) -> Firmware:
    wearer = SimulatedPerson(
        "left",
        person().geometry,
        layout(("index",), 100.0),
        np.random.default_rng(3),
        person().errors,
    )
    return Firmware(
        wearer, replace(Build(), format=wire.Format.FLOAT32), np.random.default_rng(4), flash
    )


def asked(firmware: Firmware, command: wire.Message) -> list[wire.Message]:
    return list(Decoder().feed(firmware.handle(Encoder().frame(command))))


def test_a_strips_calibration_removes_the_errors_of_its_sensors() -> None:
    plain, corrected, raw = (
        play(powered(f), 2.0, Assembler(correct=c))
        for f, c in ((Flash(), True), (flashed(), True), (flashed(), False))
    )
    for name, block in plain.items():
        np.testing.assert_allclose(
            corrected[name].values, block.values, atol=2e-5
        )  # float32 of up to 12
        assert np.abs(raw[name].of(ACC) - block.of(ACC)).max() > 0.1


def test_what_is_written_to_the_flash_is_read_back_and_outlives_the_power() -> None:
    flash, message = flashed(), message_of(drawn(5), 2, 1)
    (*_, reply) = asked(powered(flash), wire.WriteCalibration(message))
    assert reply.code is wire.ReplyCode.OK  # type: ignore[union-attr]
    assert message in asked(powered(flash), wire.ReadCalibration(2))
    assert message in asked(powered(flash), wire.Identify())


@pytest.mark.parametrize(("slot", "sensor"), [(2, 3), (7, 0), (200, 0)])
def test_a_calibration_for_a_sensor_that_is_not_there_is_refused(slot: int, sensor: int) -> None:
    (reply,) = asked(powered(flashed()), wire.WriteCalibration(wire.StripCalibration(slot, sensor)))
    assert reply.code is wire.ReplyCode.BAD_ARGUMENT  # type: ignore[union-attr]


def test_a_running_glove_keeps_its_calibration() -> None:
    firmware, message = powered(flashed()), message_of(drawn(5), 2, 1)
    asked(firmware, wire.Start())
    (reply,) = asked(firmware, wire.WriteCalibration(message))
    assert reply.code is wire.ReplyCode.BUSY  # type: ignore[union-attr]
    assert message not in asked(firmware, wire.ReadCalibration(2))


def test_a_recording_on_the_bench_gives_the_calibration_that_the_strip_needs(
    tmp_path: Path,
) -> None:
    flash = factory_flash(BENCH, np.random.default_rng(9))
    flash.stored["index"] = [drawn(k, 0.02) for k in range(3)]  # a wrong one, which must not enter
    bench, path = OnTheBench(), tmp_path / "bench.mcap"
    firmware = Firmware(bench, Build(), np.random.default_rng(4), flash)
    with Recorder(path, {}, 0.0) as recorder:
        recorder.write(firmware.handle(Encoder().frame(wire.Start())), 0.0)
        for k in range(round(bench.duration / 0.02)):
            recorder.write(b"".join(firmware.advance(0.02)), 0.02 * k)
    assert main(["calibrate-strip", str(path), "--out", str(tmp_path / "c.json")]) == 0
    sensors = json.loads((tmp_path / "c.json").read_text())["sensors"]
    for k, point in enumerate(BENCH[0].sensors):
        true = flash.errors["index"][k]
        np.testing.assert_allclose(sensors[point]["acc"]["bias"], true.bias[ACC], atol=0.005)
        np.testing.assert_allclose(sensors[point]["gyr"]["bias"], true.bias[GYR], atol=0.001)
        size = [
            np.linalg.svd(np.array(m))[1]
            for m in (sensors[point]["acc"]["matrix"], true.matrix[ACC])
        ]
        np.testing.assert_allclose(
            *size, atol=0.001
        )  # the same but for a turn of the whole sensor, which gravity does not show
        assert sensors[point]["strip_id"] == native.load(path).strip_ids[point]


def test_calibrations_are_written_over_a_port_and_a_foreign_strip_is_left_alone(
    tmp_path: Path,
) -> None:
    found = {
        "index_distal": ImuCalibration({GYR: drawn(1).matrix[GYR]}, {GYR: drawn(1).bias[GYR]}),
        "hand": drawn(2),
    }
    with virtual_glove(tmp_path / "glove", "--strips", "index") as port:
        assert sorted(strip_flash.write(str(port), found, {})) == ["hand", "index_distal"]
        with pytest.raises(
            InputError, match=r"index_distal: strip .* is plugged in, the recording is of strip abc"
        ):
            strip_flash.write(str(port), found, {"index_distal": "abc"})
        with pytest.raises(
            InputError, match="little_distal: no strip with this sensor is plugged in"
        ):
            strip_flash.write(str(port), {"little_distal": drawn(1)}, {})


def test_a_strip_that_corrects_itself_is_not_written(tmp_path: Path) -> None:
    assembler = Assembler()
    assembler.strips[2] = wire.Strip(2, True, 7, ("index_distal",))
    with pytest.raises(InputError, match="corrects its samples by itself"):
        strip_flash._places(assembler, {"index_distal": drawn(1)}, {})


def test_a_recording_that_lies_still_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "rest", "--out", str(tmp_path / "rest.zip")]) == 0
    assert main(["calibrate-strip", str(tmp_path / "rest.zip")]) == 2
    assert "no sensor of rest.zip could be calibrated" in capsys.readouterr().err


def test_all_three_quantities_have_errors_to_remove() -> None:
    for calibration in flashed().errors["index"]:
        assert set(calibration.matrix) == set(CALIBRATED)
        assert not calibration.trivial


def felt(flash: Flash, strips: tuple[str, ...] = ("thumb", "index", "force")) -> Firmware:
    wearer = SimulatedPerson(
        "left", person().geometry, layout(strips, 100.0), np.random.default_rng(3), person().errors
    )
    return Firmware(
        wearer, replace(Build(), format=wire.Format.FLOAT32), np.random.default_rng(4), flash
    )


@pytest.mark.parametrize("axes", [3, 6])
def test_force_sensors_send_what_they_read_where_a_calibration_is_told(axes: int) -> None:
    """Recorded raw, opened in newtons: as a glove tells them that corrects itself."""
    rng, strips = (
        np.random.default_rng(axes),
        ("thumb", "index", "force", "torque")[: 3 + (axes == 6)],
    )
    found = [
        ForceCalibration(
            5 * (np.eye(axes) + 0.1 * rng.normal(size=(axes, axes))), rng.normal(size=axes), 0.008
        )
        for _ in range(2)
    ]
    points = ("thumb_tip_force", "index_tip_force")
    setups = {point: ForceSetup(0.008, (), one, 0.006) for point, one in zip(points, found)}
    newtons, told, sent = (
        next(
            b
            for b in play(felt(flash, strips), 1.0, Assembler(correct=correct)).values()
            if FORCE in b.stream.quantities
        )
        for flash, correct in (
            (Flash(), True),
            (Flash(forces=setups), True),
            (Flash(forces=setups), False),
        )
    )
    np.testing.assert_allclose(told.values, newtons.values, atol=1e-4)
    np.testing.assert_allclose(
        found[0].corrected(sent.values[:, 0]), newtons.values[:, 0], atol=1e-4
    )
    assert told.stream.scale_sd == dict.fromkeys(points, pytest.approx(0.008))
    assert told.stream.turn_sd == dict.fromkeys(points, pytest.approx(0.006))


def test_a_calibration_that_is_not_the_gloves_is_refused() -> None:
    one = ForceSetup(0.01, (), ForceCalibration(np.eye(3), np.zeros(3), 0.01))
    for forces, strips, said in (
        (
            {"thumb_tip_force": one},
            ("thumb", "index", "force"),
            r"no matrix of index_tip_force; `handscope calibrate-force --finger index`",
        ),
        (
            dict.fromkeys(("thumb_tip_force", "index_tip_force"), one),
            ("thumb", "index", "force", "torque"),
            "3 by 3; axes of this glove's sensors: 6",
        ),
        ({"thumb_tip_force": one}, ("thumb",), "no strip has any; plug in the strip 'force'"),
    ):
        with pytest.raises(InputError, match=said):
            require_fitting(forces, layout(strips, 100.0))
