"""A recording replayed through the virtual glove, recorded and tracked live, against the same recording in batch."""

from pathlib import Path

import numpy as np

from app.cli import main
from tests.app.commands.test_commands import table
from tests.app.devices.virtual import virtual_glove


def test_a_replayed_recording_gives_the_same_live_in_batch_and_from_its_original(tmp_path: Path) -> None:
    original = tmp_path / "original.zip"
    assert main(["simulate", "wiggle", "--out", str(original), "--seed", "2"]) == 0
    with virtual_glove(tmp_path / "glove", "--replay", str(original)) as port:
        assert main(["record", str(port), "--out", str(tmp_path / "r.mcap"), "--live", str(tmp_path / "live")]) == 0
    assert main(["process", str(original), "--out", str(tmp_path / "batch")]) == 0
    assert main(["process", str(tmp_path / "r.mcap"), "--out", str(tmp_path / "native")]) == 0
    columns, batch = table(tmp_path / "batch", "desc-m2")
    names, native = table(tmp_path / "native", "desc-m2")
    shown_names, shown = table(tmp_path / "live", "desc-m2")
    assert columns == names == shown_names
    np.testing.assert_allclose(native, batch, atol=2e-6, equal_nan=True)  # rad, m: the wire carries float32
    same = native[np.searchsorted(native[:, 0], shown[0, 0]) :]
    assert len(shown) > 500
    np.testing.assert_array_equal(shown, same)
