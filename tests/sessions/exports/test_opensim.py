"""OpenSim itself reads the three files, and its fingertips are ours."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FINGERS, SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.exports.skeleton import Y_UP
from handscope.sessions.tables_io.writing import save_folder
from tests.sessions.exports.conftest import instants

osim = pytest.importorskip("opensim")
osim.Logger.setLevelString("error")


@pytest.fixture(scope="module")
def folder(exported: Callable[[str], Exported], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("opensim")
    save_folder(dict(exported("opensim").files), path)
    return path


def test_fingertips_of_the_model_moved_by_the_motion_are_ours_within_a_tenth_of_a_millimetre(
    folder: Path, measured: Measured
) -> None:
    model = osim.Model(str(folder / "hand.osim"))
    state = model.initSystem()
    motion = osim.TimeSeriesTable(str(folder / "motion.mot"))
    assert motion.getTableMetaDataString("inDegrees") == "yes"
    names = list(motion.getColumnLabels())
    rows = np.radians(motion.getMatrix().to_numpy())
    forearm = model.getBodySet().get("forearm")
    coordinates = [model.getCoordinateSet().get(name) for name in names]
    worst = 0.0
    for k in instants(len(rows)):
        for coordinate, value in zip(coordinates, rows[k]):
            coordinate.setValue(state, float(value), False)
        model.realizePosition(state)
        for f, finger in enumerate(FINGERS):
            tip = model.getMarkerSet().get(f"{finger}_tip").findLocationInFrame(state, forearm)
            off = tip.to_numpy() - measured.movement.tips[k, f]
            worst = max(worst, float(np.linalg.norm(off)))
    assert worst < 1e-4


def test_the_model_has_every_freedom_with_its_range(folder: Path) -> None:
    model = osim.Model(str(folder / "hand.osim"))
    model.initSystem()
    assert model.getCoordinateSet().getSize() == 23
    pip = model.getCoordinateSet().get("index_pip_flexion")
    np.testing.assert_allclose(np.degrees([pip.getRangeMin(), pip.getRangeMax()]), [-20, 120])


def test_the_palm_faces_down_on_both_hands(folder: Path, measured: Measured) -> None:
    model = osim.Model(str(folder / "hand.osim"))
    state = model.initSystem()
    model.realizePosition(state)
    dorsal = 1.0 if measured.recording.hand == "left" else -1.0
    up = model.getBodySet().get("hand").expressVectorInGround(state, osim.Vec3(dorsal, 0, 0))
    np.testing.assert_allclose(up.to_numpy(), [0, 1, 0], atol=1e-9)


def test_orientations_are_read_as_quaternions_with_y_up(folder: Path, measured: Measured) -> None:
    table = osim.TimeSeriesTableQuaternion(str(folder / "orientations.sto"))
    column = list(table.getColumnLabels()).index("index_middle")
    for k in instants(table.getNumRows(), 10):
        row = table.getRowAtIndex(int(k))
        q = np.array([row.getElt(0, column).get(c) for c in range(4)])
        ours = quat.multiply(Y_UP, measured.movement.q_GS[k, SEGMENT["index_middle"]])
        assert abs(float(q @ ours)) > 1 - 1e-8


def test_a_joint_that_was_not_measured_has_no_column_and_is_named(without_ring: Measured) -> None:
    made = export(without_ring, "opensim")
    columns = (
        made.files["motion.mot"].decode().partition("endheader\n")[2].split("\n")[0].split("\t")
    )
    assert "ring_pip_flexion" not in columns
    assert {"ring_mcp_flexion", "index_pip_flexion"} <= set(columns)
    assert any("ring_pip_flexion" in sentence for sentence in made.notices)
    assert b"nan" not in made.files["motion.mot"]
