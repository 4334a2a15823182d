"""Magnetometers on a plate, without an inertial sensor beside each, are calibrated by the same command as strips."""

import json
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.samples import ACC, GYR, MAG, TRUNK, Block, Stream
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation import magnet
from handscope.estimators.simulation.magnetic_field import EARTH, homogeneous
from handscope.estimators.simulation.trunk import MAGNETOMETERS, Q_BS
from handscope.sessions import motion_bids
from handscope.sessions.files.recording import LoadedRecording


def test_a_plate_that_was_turned_is_calibrated_and_says_the_strength_of_the_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(3)
    worn, turning = magnet.draw_worn(rng), magnet.rotate_plate(rng)
    inertial = Block(
        Stream("trunk", (TRUNK,), (GYR, ACC), 60.0, "base"),
        turning.t,
        magnet.simulate_inertial(worn, turning, rng)[:, :1],
    )
    mag = magnet.simulate_magnetic(worn, turning, homogeneous(), rng, magnet=False)
    array = Block(Stream("trunk_mag", MAGNETOMETERS, (MAG,), 60.0, "base"), turning.t, mag)
    samples = {"trunk": inertial, "trunk_mag": array}
    recording = LoadedRecording(
        "left",
        sized("left"),
        dict.fromkeys(MAGNETOMETERS, Q_BS),
        samples,
        (),
        (),
        None,
        "",
        {},
        {},
        {},
        None,
    )
    motion_bids.write(recording, tmp_path / "turned.zip")
    assert (
        main(
            ["calibrate-strip", str(tmp_path / "turned.zip"), "--out", str(tmp_path / "found.json")]
        )
        == 0
    )
    said = "".join(capsys.readouterr())
    strength = float(said.split("the field has ")[1].split(" uT")[0])
    assert strength == pytest.approx(1e6 * EARTH, rel=0.05)
    assert "trunk: 0 positions at rest found" in said
    found = json.loads((tmp_path / "found.json").read_text())["sensors"]
    assert tuple(found) == MAGNETOMETERS
    for k, name in enumerate(MAGNETOMETERS):
        np.testing.assert_allclose(found[name]["mag"]["bias"], worn.hard[k], atol=0.3e-6)
