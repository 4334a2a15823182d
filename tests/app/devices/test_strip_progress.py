"""Which of the samples that come strip after strip complete a row of the trajectory."""

from dataclasses import replace

import numpy as np

from handscope.app.devices.strip_progress import StripProgress
from handscope.estimators.data.samples import ACC, FORCE, GYR, Block, Stream

HAND = Stream("hand", ("hand",), (GYR, ACC), 100.0)
INDEX = Stream("index", ("index_distal",), (GYR, ACC), 100.0)
TIPS = Stream("fingertips", ("index_tip_force",), (FORCE,), 100.0)


def samples(stream: Stream, t: float) -> list[Block]:
    return [Block(stream, np.array([t]), np.zeros((1, 1, stream.width)))]


def test_a_row_is_complete_with_the_last_strip_of_a_sample() -> None:
    progress = StripProgress(0.1)
    progress.take([*samples(HAND, 0.0), *samples(INDEX, 0.0)])
    for t in (0.01, 0.02, 0.03):
        assert not progress.take(samples(HAND, t))
        assert not progress.take(samples(TIPS, t))
        assert progress.take(samples(INDEX, t))


def test_a_slower_strip_that_is_between_two_rows_completes_none() -> None:
    progress = StripProgress(0.1)
    forearm = Stream("forearm", ("forearm",), (GYR, ACC), 60.0)
    progress.take([*samples(HAND, 0.0), *samples(forearm, 0.0)])
    assert not progress.take(samples(HAND, 0.01))
    assert progress.take(samples(forearm, 0.0167))
    assert not progress.take(samples(forearm, 0.019))  # all have got further, to no row
    assert progress.take(samples(HAND, 0.018))


def test_a_strip_is_waited_for_no_longer_than_the_patience() -> None:
    progress = StripProgress(0.1)
    progress.take([*samples(HAND, 0.0), *samples(INDEX, 0.0)])
    took = [progress.take(samples(HAND, 0.01 * k)) for k in range(1, 30)]
    assert not any(took[:9]) and all(took[11:])


def test_a_strip_that_is_read_as_another_fingers_holds_nothing_up() -> None:
    progress = StripProgress(0.1)
    progress.take([*samples(HAND, 0.0), *samples(INDEX, 0.0)])
    ring = replace(INDEX, name="ring")
    took = [
        progress.take(samples(HAND, 0.01 * k)) or progress.take(samples(ring, 0.01 * k))
        for k in range(1, 30)
    ]
    assert all(took[11:])


def test_where_no_row_needs_them_samples_are_taken_as_they_come() -> None:
    progress = StripProgress(0.1)
    assert progress.take(samples(TIPS, 0.0)) and progress.take(samples(TIPS, 0.01))
