"""Calibrations of force sensors that a glove does not keep: applied to its strip live and from the recording alike."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handscope.estimators.data.samples import FORCE, Block, Stream, join
from handscope.estimators.errors import InputError
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.tables_io import force_calibrations
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.framing import Encoder
from tests.glove import bursts, frames, identity

POINTS = ("thumb_tip_force", "index_tip_force")
STRIP = 0xF0CE
MATRIX, OFFSET = (
    np.array([[0.6, 0.01, 0.0], [0.0, 0.7, 0.02], [0.03, 0.0, 0.5]]),
    np.array([0.5, -0.25, 1.0]),
)
SENT = np.random.default_rng(4).uniform(-5, 5, (12, 2, 3)).astype("<f4").astype(float)
FORCES = (SENT - OFFSET) @ MATRIX.T


def setup(**other: Any) -> dict[str, Any]:
    channels = [{"name": name, "units": "N"} for name in "xyz"]
    return {
        "channels": channels,
        "matrix": MATRIX.tolist(),
        "offset": OFFSET.tolist(),
        "scale_sd": 0.008,
        "left_over": [0.1],
        **other,
    }


def told(strip: int = STRIP, points: tuple[str, ...] = POINTS) -> dict[str, Any]:
    """Metadata of a recording."""
    return {force_calibrations.SETUPS: {f"{strip:x}": dict.fromkeys(points, setup())}}


def sent(own: bool = False, limit: float = 0.0) -> list[wire.Message]:
    """A strip that corrects nothing and tells nothing, or its own calibration of one sensor."""
    info = wire.StreamInfo(9, 4, 0, (FORCE,), wire.Format.FLOAT32, 12.0, (1.0,), (limit,))
    flash = (
        [ForceSensorCalibration(4, 0, 0.02, None, (0.0,) * 3, tuple(map(float, np.eye(3).ravel())))]
        if own
        else []
    )
    block = Block(Stream("force", POINTS, (FORCE,), 12.0), np.arange(12) / 12, SENT)
    return [
        identity(),
        wire.Strip(4, True, STRIP, POINTS),
        *flash,
        info,
        *bursts("force", block, info),
    ]


def fed(messages: list[wire.Message], metadata: dict[str, Any], correct: bool = True) -> Block:
    assembler, encoder = (
        Assembler(correct=correct, stored_forces=force_calibrations.of_recording(metadata)),
        Encoder(),
    )
    return join([b for f in frames(messages, encoder) for b in assembler.feed(f, 100.0)])


def test_what_is_kept_for_a_strip_turns_what_it_sends_to_forces_and_says_how_sure_they_are() -> (
    None
):
    block = fed(sent(), told())
    np.testing.assert_allclose(block.values, FORCES, atol=1e-12)
    assert block.stream.scale_sd == dict.fromkeys(POINTS, 0.008)
    assert block.stream.name == "fingertips_force"


@pytest.mark.parametrize(
    ("metadata", "own"), [({}, False), (told(strip=77), False), (told(), True)]
)
def test_another_strip_and_one_with_a_calibration_of_its_own_are_left_alone(
    metadata: dict[str, Any], own: bool
) -> None:
    block = fed(sent(own), metadata)
    np.testing.assert_array_equal(block.values, SENT)
    assert block.stream.scale_sd.get(POINTS[0]) == (pytest.approx(0.02) if own else None)


def test_a_sensor_without_a_calibration_is_read_as_sent_and_both_are_infinite_at_their_limit() -> (
    None
):
    block = fed(sent(limit=4.5), told(points=POINTS[:1]))
    over = np.abs(SENT) >= 0.98 * 4.5
    assert over[:, 0].any() and over[:, 1].any()
    np.testing.assert_allclose(
        block.values[:, 0],
        np.where(over[:, 0].any(axis=1, keepdims=True), np.inf, FORCES[:, 0]),
        atol=1e-12,
    )
    np.testing.assert_array_equal(block.values[:, 1], np.where(over[:, 1], np.inf, SENT[:, 1]))
    assert block.stream.scale_sd == {POINTS[0]: 0.008}


def test_a_recording_opens_with_the_forces_that_were_shown_and_keeps_what_was_sent(
    tmp_path: Path,
) -> None:
    path, live = tmp_path / "r.mcap", fed(sent(), told())
    with Recorder(path, {"hand": "left", **told()}, 0.0) as recorder:
        for k, data in enumerate(frames(sent())):
            recorder.write(data, k * 1e-3)
    opened = native.load(path).samples["fingertips_force"]
    np.testing.assert_array_equal(opened.values, live.values)
    assert opened.stream.scale_sd == live.stream.scale_sd
    np.testing.assert_array_equal(
        native.load(path, correct=False).samples["fingertips_force"].values, SENT
    )


def test_what_the_data_folder_keeps_goes_into_a_recording_without_how_sure_each_number_is(
    tmp_path: Path,
) -> None:
    assert force_calibrations.read_stored(tmp_path) == {}
    place = force_calibrations.path_of(tmp_path, STRIP)
    place.parent.mkdir()
    place.write_text(json.dumps({"ForceSetup": dict.fromkeys(POINTS, setup())}))
    found = force_calibrations.read_stored(tmp_path)
    assert "left_over" not in found[force_calibrations.SETUPS][f"{STRIP:x}"][POINTS[0]]
    np.testing.assert_allclose(fed(sent(), found).values, FORCES, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "it is no ForceSetup"),
        ('{"ForceSetup": {"thumb_tip_force": {"scale_sd": 7}}}', "scale_sd is 7"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_with_what_to_do(
    tmp_path: Path, text: str, said: str
) -> None:
    place = force_calibrations.path_of(tmp_path, STRIP)
    place.parent.mkdir()
    place.write_text(text)
    with pytest.raises(
        InputError, match=f"f0ce.json cannot be read .*{said}.*calibrate them again or remove it"
    ):
        force_calibrations.read_stored(tmp_path)


def test_metadata_that_is_no_table_is_refused() -> None:
    with pytest.raises(InputError, match="no tables by strip"):
        force_calibrations.of_recording({force_calibrations.SETUPS: {"f0ce": 7}})
