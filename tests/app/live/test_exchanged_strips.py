"""A virtual glove with two strips on each other's finger: the check finds them, one press puts them right, the recording says it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.live.station import Station
from handscope.app.live.wizard.machine import State
from handscope.app.protocols import load_all
from handscope.app.workers.turns import Turns
from handscope.estimators.data.samples import GYR
from handscope.sessions.formats import recordings as formats_recordings
from tests.app.devices.virtual import virtual_glove, wait_for
from tests.app.live.test_live_numbers import setup_of


@pytest.mark.slow
def test_two_strips_on_each_others_finger_are_found_exchanged_and_read_as_worn(
    tmp_path: Path,
) -> None:
    with virtual_glove(
        tmp_path / "glove",
        "--hand",
        "left",
        "--strips",
        "index,ring",
        "--exchange",
        "index",
        "ring",
    ) as port:
        setup = replace(setup_of(tmp_path), port=str(port), protocols=tuple(load_all().values()))
        with Station("test", setup, lambda _: None, Turns()) as station:
            wait_for(lambda: "check" in station.snapshot()["wizard"]["actions"])
            station.act("check")
            wait_for(lambda: station._wizard.state is State.CHECKED)
            told = station.snapshot()["wizard"]
            assert told["check"]["moved"] == {"index": "ring", "ring": "index"}
            assert told["check"]["exchange"] == [
                {"strip": "ring", "finger": "index"},
                {"strip": "index", "finger": "ring"},
            ]
            station.act("exchange")
            wait_for(lambda: station.glove.assembler.exchanged)
            assert station._wizard.state is State.CHECK
            wait_for(lambda: dict(station._wizard.seen).get("index"))
            assert dict(station._wizard.seen)["index"] == "index"
            now = station.tracking.newest_sample()
    read = formats_recordings.load(setup.recording)
    assert (
        "the strip of the index finger was worn on the ring finger and is read as that"
        in read.warnings
    )
    index = read.samples["index"].between(now - 0.8, now)
    ring = read.samples["ring"].between(now - 0.8, now)
    moved = [np.sqrt((b.of(GYR)[:, -1] ** 2).sum(axis=1).mean()) for b in (index, ring)]
    assert moved[0] > 5 * moved[1]  # the index finger has just bent
