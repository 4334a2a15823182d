"""ezc3d and our own reader read the points, angles and events."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FINGERS, JOINT
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.formats import c3d as own_reader

ezc3d = pytest.importorskip("ezc3d")


@pytest.fixture(scope="module")
def file(exported: Callable[[str], Exported], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("c3d") / "a.c3d"
    path.write_bytes(exported("c3d").files[""])
    return path


def test_ezc3d_reads_fingertips_angles_and_events(file: Path, measured: Measured) -> None:
    read = ezc3d.c3d(str(file))
    labels = read["parameters"]["POINT"]["LABELS"]["value"]
    points = read["data"]["points"]
    for f, finger in enumerate(FINGERS):
        tip = points[:3, labels.index(f"{finger}_tip")].T
        np.testing.assert_allclose(tip / 1e3, measured.movement.tips[:, f], atol=1e-4)
    flexion = points[0, labels.index("index_pip_angles")]
    ours = measured.movement.angles[:, JOINT["index_pip"], 0]
    np.testing.assert_allclose(flexion, np.degrees(ours), atol=1e-3)
    parameters = read["parameters"]
    assert "index_pip_angles" in parameters["POINT"]["ANGLES"]["value"]
    assert parameters["POINT"]["UNITS"]["value"] == ["mm"]
    assert parameters["POINT"]["RATE"]["value"][0] == pytest.approx(100 / 7, rel=1e-4)
    assert "rom_mcp begin" in parameters["EVENT"]["LABELS"]["value"]
    times = parameters["EVENT"]["TIMES"]["value"]
    began = parameters["EVENT"]["LABELS"]["value"].index("rom_mcp begin")
    assert times[0, began] * 60 + times[1, began] == pytest.approx(4.0 - measured.movement.t[0])
    assert "".join(parameters["HANDSCOPE"]["RECORDING_SHA256"]["value"]) == measured.origin.checksum


def test_our_own_reader_reads_the_points(file: Path, measured: Measured) -> None:
    read = own_reader.read_markers(file)
    tip = read.places[:, read.names.index("little_tip")]
    np.testing.assert_allclose(tip, measured.movement.tips[:, 4], atol=1e-4)


def test_what_is_not_known_is_marked_and_what_was_never_measured_is_left_out(
    without_ring: Measured, tmp_path: Path
) -> None:
    made = export(without_ring, "c3d")
    (tmp_path / "a.c3d").write_bytes(made.files[""])
    read = ezc3d.c3d(str(tmp_path / "a.c3d"))
    labels = read["parameters"]["POINT"]["LABELS"]["value"]
    assert "ring_pip_angles" not in labels
    gap = read["data"]["points"][:3, labels.index("index_dip"), 52]
    assert np.isnan(gap).all()
    assert any("ring_tip" in n or "ring_dip" in n for n in made.notices)
