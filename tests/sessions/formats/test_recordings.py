"""One recording through every format, and back."""

from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.sessions import motion_bids
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from tests.glove import as_float32, frames, whole_session
from tests.simulated import DEG, calibrated, in_strips, loaded, tracked, with_samples


def _native(path: Path) -> LoadedRecording:
    """What a glove sends of the simulated recording, recorded and opened."""
    simulated = in_strips("left")
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        for sent, frame in zip(
            whole_session(simulated.samples),
            frames(s.message for s in whole_session(simulated.samples)),
        ):
            recorder.write(frame, sent.arrival)
        for k, event in enumerate(simulated.events):
            recorder.event(f"e{k}", event, 120.0)
    return formats_recordings.load(path)


def test_native_to_folder_to_zip_keeps_every_number(tmp_path: Path) -> None:
    native = _native(tmp_path / "a.mcap")
    motion_bids.write(native, tmp_path / "folder")
    from_folder = formats_recordings.load(tmp_path / "folder")
    motion_bids.write(from_folder, tmp_path / "b.zip")
    from_zip = formats_recordings.load(tmp_path / "b.zip")
    for recording in (native, from_folder, from_zip):
        assert set(recording.samples) == set(in_strips("left").samples)
        for name, block in in_strips("left").samples.items():
            np.testing.assert_array_equal(
                recording.samples[name].values, as_float32(block), err_msg=name
            )
            np.testing.assert_array_equal(
                recording.samples[name].t, native.samples[name].t, err_msg=name
            )
            assert recording.samples[name].stream.rate == block.stream.rate
            assert recording.samples[name].stream.sensors == block.stream.sensors
        assert recording.events == in_strips("left").events
        assert (recording.hand, recording.geometry) == ("left", in_strips("left").geometry)


def test_whatever_the_format_the_hand_moves_the_same(tmp_path: Path) -> None:
    native = _native(tmp_path / "a.mcap")
    motion_bids.write(native, tmp_path / "b.zip")
    moved = []
    for recording in (
        loaded(in_strips("left")),
        native,
        formats_recordings.load(tmp_path / "b.zip"),
    ):
        simulated = with_samples(in_strips("left"), recording.samples)
        moved.append(tracked(simulated, calibration=calibrated(simulated)))
    np.testing.assert_array_equal(moved[1].angles, moved[2].angles)
    np.testing.assert_allclose(moved[0].angles, moved[1].angles, atol=0.001 * DEG)


def test_a_checksum_needs_a_file(tmp_path: Path) -> None:
    _native(tmp_path / "a.mcap")
    assert len(formats_recordings.checksum(tmp_path / "a.mcap")) == 64
    with pytest.raises(InputError, match="is not a file"):
        formats_recordings.checksum(tmp_path / "b.mcap")
