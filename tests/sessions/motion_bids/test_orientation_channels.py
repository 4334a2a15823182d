"""Orientations in Motion-BIDS: written, read, and refused where they are not as the contract says."""

from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR, ORIENTATION, Block, Stream
from handscope.estimators.errors import InputError
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids.orientation_channels import orientation_columns
from tests.bids import recording

POINTS = ("hand", "index_proximal")


def _orientations(rows: int = 40, name: str = "device") -> Block:
    q = np.random.default_rng(2).normal(size=(rows, len(POINTS), 4))
    q /= np.linalg.norm(q, axis=2, keepdims=True)
    return Block(Stream(name, POINTS, (ORIENTATION,), 100.0, name), np.arange(rows) / 100.0, q)


def _channel(point: str, component: str, units: str = "n/a", kind: str = "ORNT") -> dict[str, str]:
    name = f"{point}_{component}"
    return {
        "name": name,
        "component": component,
        "type": kind,
        "tracked_point": point,
        "units": units,
    }


def test_orientations_are_read_back_to_the_last_bit(tmp_path: Path) -> None:
    whole = recording()
    block = _orientations()
    alone = LoadedRecording(whole.hand, whole.geometry, whole.mounting, {"device": block}, ())
    motion_bids.write(alone, tmp_path / "r.zip")
    read = motion_bids.load(tmp_path / "r.zip").samples["device"]
    np.testing.assert_array_equal(read.values, block.values)
    assert (read.stream.sensors, read.stream.quantities) == (POINTS, (ORIENTATION,))


def test_beside_rates_they_are_a_stream_of_their_own(tmp_path: Path) -> None:
    whole = recording()
    motion_bids.write(whole, tmp_path / "r")
    base = next(p for p in (tmp_path / "r").rglob("*_tracksys-index_channels.tsv"))
    lines = base.read_text().splitlines()
    names = lines[0].split("\t")
    extra = [{**dict.fromkeys(names, "n/a"), **_channel("hand", f"quat_{c}")} for c in "wxyz"]
    base.write_text("\n".join([*lines, *("\t".join(e[n] for n in names) for e in extra)]) + "\n")
    table = base.with_name(base.name.replace("channels", "motion"))
    table.write_text("".join(f"{row}\t1\t0\t0\t0\n" for row in table.read_text().splitlines()))
    read = motion_bids.load(tmp_path / "r").samples
    assert GYR in read["index"].stream.quantities
    assert ORIENTATION not in read["index"].stream.quantities
    assert read["index_orientation"].stream.sensors == ("hand",)
    np.testing.assert_array_equal(read["index_orientation"].values[:, 0, 0], 1.0)


@pytest.mark.parametrize(
    ("channels", "why"),
    [
        ([_channel("hand", f"quat_{c}") for c in "wxy"], "not all of quat_w"),
        ([_channel("hand", f"quat_{c}") for c in "wwxy"], "two ORNT channels"),
        ([_channel("hand", "x")], "component x"),
        ([_channel("hand", f"quat_{c}", "deg") for c in "wxyz"], "unit deg"),
    ],
)
def test_what_is_no_orientation_is_refused(channels: list[dict[str, str]], why: str) -> None:
    with pytest.raises(InputError, match=why):
        orientation_columns("device", channels)
