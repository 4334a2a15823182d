"""`handscope learn-magnet`: what a movement told is written for other recordings and said, with what it hardly told."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.data.magnet_declaration import Plate, plate_from
from handscope.estimators.magnet.pipeline import setup_learning
from handscope.estimators.magnet.pipeline.setup_learning import EstimatedSetup
from handscope.sessions.formats import recordings as formats_recordings

TOLD = Plate(
    {"trunk_mag_1": (0.0, 0.0, 0.0), "trunk_mag_2": (0.1, 0.0, 0.0)},
    (0.32, 0.0, 0.0),
    (0.0, 0.0, 0.01),
    4.98e-5,
)
BETTER = Plate(
    {"trunk_mag_1": (0.003, 0.0, 0.0), "trunk_mag_2": (0.1, 0.0, 0.0)},
    (0.0, 0.3, 0.0),
    (0.0, 0.004, 0.01),
    4.98e-5,
)


def test_what_was_learnt_is_written_as_a_magnet_setup_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def estimate_setup(
        plate: Plate, errors: setup_learning.DeclarationErrors, *_: object
    ) -> EstimatedSetup:
        asked.append((plate, errors.moment, errors.place, errors.places))
        sd = np.array([[0.001] * 3, [0.0029] * 3])
        return EstimatedSetup(
            BETTER, tuple(BETTER.places), np.full(3, 0.006), np.full(3, 0.002), sd, 0.9
        )

    monkeypatch.setattr(setup_learning, "estimate_setup", estimate_setup)
    monkeypatch.setattr(
        formats_recordings, "load", lambda *_: SimpleNamespace(plate=TOLD, samples={}, mounting={})
    )
    out = tmp_path / "setup.json"
    assert (
        main(
            [
                "learn-magnet",
                "half_a_minute.zip",
                "--out",
                str(out),
                "--moment-error",
                "0.2",
                "--place-error",
                "8",
            ]
        )
        == 0
    )
    assert asked == [(TOLD, 0.2, 0.008, 0.003)]
    assert plate_from(json.loads(out.read_text())["MagnetSetup"]) == BETTER
    said = capsys.readouterr().out
    for words in (
        "followed for 90% of the time",
        "moment: 0.32 A m^2 told, 0.3 ± 0.006 found, turned by 90.0 deg\n",
        "magnet's place: moved by 4.0 ± 2.0 mm\n",
        "trunk_mag_1: moved by 3.0 ± 1.0 mm\n",
        "trunk_mag_2: moved by 0.0 ± 2.9 mm; this movement hardly told it",
        f"MagnetSetup as learnt: {out}",
    ):
        assert words in said
