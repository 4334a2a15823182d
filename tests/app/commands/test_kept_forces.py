"""`handscope calibrate-force --keep`: for the strip of a glove that keeps no calibration of its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.live.stations import live_setup
from handscope.sessions.db.tables import PatientSession
from handscope.sessions.tables_io import force_calibrations
from tests.app.commands.test_calibrate_force import table
from tests.app.devices.virtual import virtual_glove

POINTS = ("thumb_tip_force", "index_tip_force")
WORN = ("--hand", "left", "--strips", "thumb,index,force")


def calibrated(folder: Path, port: Path, finger: str) -> int:
    (folder / "loads.csv").write_text(table())
    words = [
        "calibrate-force",
        str(folder / "loads.csv"),
        "--finger",
        finger,
        "--keep",
        str(port),
        "--data",
        str(folder / "data"),
    ]
    return main(words)


def setup_file(folder: Path) -> Path:
    """What a virtual glove's force sensors read."""
    one = {
        "channels": [{"name": n, "units": "V"} for n in "xyz"],
        "matrix": (8 * np.eye(3)).tolist(),
        "offset": [1, 1, 1],
        "scale_sd": 0.01,
    }
    path = folder / "reads.json"
    path.write_text(json.dumps({"ForceSetup": dict.fromkeys(POINTS, one)}))
    return path


def test_both_fingers_are_kept_for_the_strip_and_go_into_every_session_that_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with virtual_glove(
        tmp_path / "glove", *WORN, "--force-setup", str(setup_file(tmp_path)), "--untold"
    ) as port:
        assert [calibrated(tmp_path, port, finger) for finger in ("thumb", "index")] == [0, 0]
    assert "live sessions that begin from now on apply it" in capsys.readouterr().out
    (kept,) = force_calibrations.read_stored(tmp_path / "data")[force_calibrations.SETUPS].values()
    assert set(kept) == set(POINTS)
    setup = live_setup("m2", {}, tmp_path / "data")(
        PatientSession(id=3, hand="left", geometry={}), tmp_path / "r.mcap", "port", "P-1"
    )
    assert (
        setup.about[force_calibrations.SETUPS]
        == force_calibrations.read_stored(tmp_path / "data")[force_calibrations.SETUPS]
    )


def test_a_glove_that_tells_a_calibration_or_has_no_such_sensor_is_refused_and_nothing_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with virtual_glove(
        tmp_path / "tells", *WORN, "--force-setup", str(setup_file(tmp_path))
    ) as port:
        assert calibrated(tmp_path, port, "thumb") == 2
        assert (
            "thumb_tip_force: this strip tells a calibration of its own" in capsys.readouterr().err
        )
        assert calibrated(tmp_path, port, "little") == 2
        assert (
            "little_tip_force: no strip with this sensor is plugged in" in capsys.readouterr().err
        )
    assert force_calibrations.read_stored(tmp_path / "data") == {}
