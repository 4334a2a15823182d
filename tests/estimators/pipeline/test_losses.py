"""Samples lost on their way lower the grade of what rests on them."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import MAG, Block, Stream
from handscope.estimators.data.trajectory import Flag, PlaceFlag
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.measures.figure import grade_of
from handscope.estimators.measures.reach_place import PlaceMeasure, measure_places
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.losses import find_gaps, mark_losses
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.measures.trajectories import made
from tests.simulated import INSTANT, pose_and_wiggle, with_samples


def with_losses(recording: Simulated, share: float) -> Simulated:
    """The recording without that share of every stream's samples."""
    rng = np.random.default_rng(4)
    kept = {name: rng.random(len(b.t)) >= share for name, b in recording.samples.items()}
    return with_samples(
        recording,
        {n: Block(b.stream, b.t[kept[n]], b.values[kept[n]]) for n, b in recording.samples.items()},
    )


@pytest.mark.parametrize(("share", "grade"), [(0.0, "good"), (0.12, "fair")])
def test_figures_of_a_recording_that_lost_12_percent_are_not_good(share: float, grade: str) -> None:
    moved = process(m2, INSTANT, with_losses(pose_and_wiggle("left"), share)).trajectory
    columns = [SEGMENT["hand"], SEGMENT["index_proximal"]]
    assert grade_of(moved.flags[:, columns])[0] == grade
    lost = (moved.flags[:, columns[0]] & Flag.LOST) != 0
    assert lost.mean() == pytest.approx(share, abs=0.02)


def test_a_reach_that_lost_12_percent_of_the_magnetometers_samples_is_not_good() -> None:
    n = 1000
    moved = replace(
        made(n),
        place=np.tile([0.3, 0.0, 0.0], (n, 1)),
        place_sd=np.full((n, 3), 0.01),
        place_flags=np.zeros(n, np.uint8),
        q_trunk=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        q_trunk_sd=np.full((n, 3), 0.01),
    )
    kept = np.random.default_rng(4).random(n) >= 0.12
    stream = Stream("trunkmag", ("trunk",), (MAG,), 100.0)
    mark_losses(moved, [Block(stream, moved.t[kept], np.zeros((kept.sum(), 1, 3)))])
    assert moved.place_flags is not None
    assert ((moved.place_flags & PlaceFlag.LOST) != 0).mean() > 0.1
    found = measure_places(PlaceMeasure(), moved, [(0.0, 9.0)], lambda *_: None)
    assert found is not None and found.grade == "fair"


def test_gaps_are_found_where_the_steps_are_regular_and_nowhere_else() -> None:
    t = np.arange(100) * 0.01
    regular = np.delete(t, [40, 41, 70])
    np.testing.assert_allclose(list(find_gaps(regular, 100.0)), [(t[40], t[42]), (t[70], t[71])])
    jitter = np.random.default_rng(1).uniform(-0.001, 0.001, len(t))
    assert list(find_gaps(t + jitter, 100.0)) == []
    arrivals = np.repeat(t[::5], 5) + np.tile(np.arange(5) * 1e-4, 20)  # five at a time
    assert list(find_gaps(arrivals, 100.0)) == []
