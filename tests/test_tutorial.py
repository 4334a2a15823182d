"""The tutorial's code blocks do what the tutorial says: a method, a measure and a task by a stranger."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from handscope.app import protocols
from handscope.estimators import measures
from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.hand.anatomy import FLEXION, JOINT
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import MethodTable, m2
from handscope.estimators.pipeline import run
from handscope.estimators.pipeline.method import Method
from tests.simulated import calibrated, in_strips, with_samples

PAGE = Path(__file__).parents[1] / "docs" / "tutorials" / "write-a-method.md"
BLOCKS = dict(
    re.findall(r'^```\w+ title="([^"]+)"\n(.*?)^```', PAGE.read_text(), re.MULTILINE | re.DOTALL)
)


def module_of(file: str) -> ModuleType:
    """A code block of the page as the module that it is saved as."""
    name = "handscope." + file.removesuffix(".py").replace("/", ".")
    made = ModuleType(name)
    sys.modules[name] = made  # dataclasses look their module up
    try:
        exec(compile(BLOCKS[file], file, "exec"), made.__dict__)
    finally:
        del sys.modules[name]
    return made


def test_the_method_fills_the_joints_that_have_no_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    coupled = module_of("estimators/methods/coupled.py")
    monkeypatch.setitem(sys.modules, "handscope.estimators.methods.coupled", coupled)
    table = MethodTable[Method[Any, Any]]("m2", "coupled")
    whole = in_strips("left")
    index = whole.samples["index"]  # as if its last sensor were not worn
    worn = replace(index.stream, sensors=index.stream.sensors[:2])
    short = Block(worn, index.t, index.values[:, :2])
    recording = with_samples(whole, {**whole.samples, "index": short})
    calibration = calibrated(recording, coupled.Params())
    pieces = run.run(table["coupled"], coupled.Params(), [calibration], recording)
    found = trajectory.join(list(pieces), "left").angles
    pip, dip, ring = (JOINT[name] for name in ("index_pip", "index_dip", "ring_dip"))
    known = np.isfinite(found[:, pip, FLEXION])
    assert known.sum() > 1000
    np.testing.assert_allclose(found[known, dip, FLEXION], found[known, pip, FLEXION] * 2 / 3)
    plain = trajectory.join(list(run.run(m2, m2.Params(), [calibration], recording)), "left").angles
    assert np.isnan(plain[:, dip, FLEXION]).all()
    np.testing.assert_array_equal(found[:, ring], plain[:, ring])


def test_the_measure_and_the_task_are_found_and_give_figures(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rest = module_of("estimators/measures/rest_posture.py")
    monkeypatch.setitem(measures.MEASURES, "rest_posture", rest)  # type: ignore[arg-type]
    folder = tmp_path / "protocols"
    folder.mkdir()
    (folder / "rest_posture.json").write_text(BLOCKS["rest_posture.json"])
    offered, mistakes = protocols.offered(tmp_path)
    assert mistakes == []
    task = offered["rest_posture"]
    still = still_hand(flexion=0.5)
    event = Event(0.0, task.duration or 0.0, "task", {"task_name": task.name})
    results = [r for r in assess(still, [event]) if r.measure == "rest_posture"]
    found = {f.name: f.value for f in results[0].figures}
    assert found["index_pip_rest_flexion"] == pytest.approx(0.5)
    assert len(found) == 4


def still_hand(flexion: float) -> trajectory.Trajectory:
    """Five seconds of a hand whose PIP joints are bent by as much."""
    t = np.arange(500) / 100
    empty = trajectory.empty("left")
    shape = (len(t), *empty.angles.shape[1:])
    angles = np.zeros(shape)
    for finger in ("index", "middle", "ring", "little"):
        angles[:, JOINT[f"{finger}_pip"], FLEXION] = flexion
    return trajectory.Trajectory(
        "left",
        t,
        angles,
        np.tile([1.0, 0.0, 0.0, 0.0], (len(t), empty.q_GS.shape[1], 1)),
        np.zeros((len(t), 5, 3)),
        np.zeros((len(t), empty.flags.shape[1]), np.uint8),
    )
