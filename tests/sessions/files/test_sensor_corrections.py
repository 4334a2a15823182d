"""Corrections that a recording's events ask for: applied when it is read, once, and raw samples stay raw."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.hand.geometry import sized
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.files.sensor_corrections import (
    CORRECTION,
    correct_recording,
    from_finding,
    parse,
)
from handscope.sessions.formats import recordings as formats

SENSORS = ("hand", "index_proximal", "index_middle")
SIGN = "gyroscope index_middle 1 0 0 0 1 0 0 0 -1"


def recorded(*texts: str) -> LoadedRecording:
    t = np.arange(0.0, 1.0, 0.01)
    values = np.arange(len(t) * 18, dtype=float).reshape(len(t), 3, 6)
    events = tuple(Event(0.5, 0.0, CORRECTION, {CORRECTION: text}) for text in texts)
    block = Block(Stream("imu", SENSORS, (GYR, ACC), 100.0), t, values)
    return LoadedRecording("left", sized("left"), {}, {"imu": block}, events)


def readings(recording: LoadedRecording, name: str) -> np.ndarray:
    block = next(iter(recording.samples.values()))
    return np.asarray(block.values[:, block.stream.sensors.index(name)])


def test_exchanged_sensors_are_read_in_each_others_place() -> None:
    raw = recorded("exchange index_proximal index_middle")
    read = correct_recording(raw)
    np.testing.assert_array_equal(readings(read, "index_middle"), readings(raw, "index_proximal"))
    np.testing.assert_array_equal(readings(read, "hand"), readings(raw, "hand"))
    assert read.warnings == (
        "the readings of index_proximal, index_middle were exchanged, as a correction in the recording says",
    )


def test_a_gyroscope_with_a_wrong_sign_is_read_with_the_right_one_and_its_accelerometer_as_it_is() -> (
    None
):
    raw = recorded(SIGN)
    off = readings(correct_recording(raw), "index_middle") / readings(raw, "index_middle")
    np.testing.assert_array_equal(off, np.tile([1, 1, -1, 1, 1, 1], (100, 1)))


def test_what_is_corrected_is_not_corrected_again_when_it_is_exported_and_read(
    tmp_path: Path,
) -> None:
    once = correct_recording(recorded(SIGN))
    assert correct_recording(once) is once
    motion_bids.write(once, tmp_path / "bids")
    np.testing.assert_allclose(
        readings(formats.load(tmp_path / "bids"), "index_middle"),
        readings(once, "index_middle"),
        rtol=1e-5,
    )


@pytest.mark.parametrize(
    "text", ["", "exchange hand", "exchange hand nose", "gyroscope hand 1 2 3", "turn hand 3"]
)
def test_a_correction_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="correction"):
        correct_recording(recorded(text))


def test_findings_leave_corrections_that_can_be_written_and_read() -> None:
    pairs = (("index_proximal", "ring_proximal"), ("index_middle", "ring_middle"))
    exchange = from_finding((), {"exchange": pairs})
    assert exchange is not None and exchange.names["ring_middle"] == "index_middle"
    gain = from_finding(("hand", "index_middle"), {"gyr": np.eye(3) / 1.3})
    assert gain is not None and parse(gain.text).sensors == ("hand", "index_middle")
    np.testing.assert_allclose(parse(gain.text).rates["hand"], np.eye(3) / 1.3, rtol=1e-5)
    assert from_finding(("hand",), {"delay": 0.1}) is None and from_finding((), None) is None


def test_raw_samples_can_still_be_read(tmp_path: Path) -> None:
    raw = recorded(SIGN)
    motion_bids.write(replace(raw, events=raw.events), tmp_path / "bids")
    np.testing.assert_allclose(
        readings(formats.load(tmp_path / "bids", correct=False), "index_middle"),
        readings(raw, "index_middle"),
        rtol=1e-5,
    )
