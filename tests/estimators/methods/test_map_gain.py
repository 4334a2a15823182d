"""Self-calibration is proposed for fingers that moved enough, and for no others."""

from dataclasses import replace

import pytest

from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.methods import m2, map_gain
from handscope.estimators.methods.map_gain import gaining_fingers
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import Simulated
from handscope.validation.reproduce.experiments import Trial, performed
from tests.simulated import pose_and_wiggle

WORN = ("hand", *CHAINS["index"], *CHAINS["little"])


@pytest.mark.parametrize(
    ("experiment", "gaining"), [("free", ("index", "little")), ("tapping", ()), ("F-F3", ())]
)
def test_fingers_that_moved_freely_gain(experiment: str, gaining: tuple[str, ...]) -> None:
    made = only(performed(Trial(experiment, 3)), WORN)
    tracked = process(m2, m2.Params(), made)
    assert gaining_fingers(made, tracked.calibrations[0], tracked.trajectory) == gaining


def test_nothing_gains_without_a_sensor_on_the_hand() -> None:
    made = performed(Trial("free", 3))
    tracked = process(m2, m2.Params(), only(made, WORN))
    bare = only(made, CHAINS["index"])
    assert gaining_fingers(bare, tracked.calibrations[0], tracked.trajectory) == ()


def test_a_hand_that_rests_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its fingers did: what their readings tell costs seconds."""
    made = only(pose_and_wiggle("left"), WORN)
    tracked = process(m2, m2.Params(), made)
    monkeypatch.setattr(map_gain, "accumulate_stretch", None)
    assert gaining_fingers(made, tracked.calibrations[0], tracked.trajectory) == ()


def only(made: Simulated, worn: tuple[str, ...]) -> Simulated:
    """The recording of these sensors alone."""
    samples = {}
    for name, block in made.samples.items():
        own = [k for k, s in enumerate(block.stream.sensors) if s in worn]
        sensors = tuple(block.stream.sensors[k] for k in own)
        if own:
            stream = replace(block.stream, sensors=sensors)
            samples[name] = Block(stream, block.t, block.values[:, own])
    return replace(made, samples=samples)
