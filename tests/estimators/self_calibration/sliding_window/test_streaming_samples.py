"""Readings while they come are those of the whole recording."""

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.self_calibration import sample_preparation
from handscope.estimators.self_calibration.sliding_window import streaming_samples


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0, 480.0])
def test_readings_and_what_is_doubted_of_them_are_as_of_the_whole_recording(rate: float) -> None:
    """A mean over faster samples is as noisy as one sample at its own rate; a clipped acceleration is worth nothing."""
    stream = Stream(
        "imu", ("hand", "index_proximal"), (GYR, ACC), rate, "imu", {GYR: 35.0, ACC: 160.0}
    )
    values = np.random.default_rng(1).normal(size=(round(rate), 2, 6))
    values[len(values) // 2, 1, 4] = 160.0
    block = Block(stream, np.arange(len(values)) / rate, values)
    _, whole = sample_preparation.prepare_readings([block], stream.sensors, 0.0, 1.0)
    state = streaming_samples.store_block(streaming_samples.start(stream), block)
    _, nodes = streaming_samples.take_nodes(state, len(whole), max_gap=0.1)
    rows = [SEGMENT[s] for s in stream.sensors]
    np.testing.assert_allclose(nodes.values[:, rows, :3], whole.gyr, atol=1e-9)
    np.testing.assert_allclose(nodes.doubt[:, rows, 0], whole.gyr_doubt, rtol=1e-9)
    np.testing.assert_allclose(nodes.doubt[:, rows[0], 1], whole.acc_doubt[:, 0], rtol=1e-9)
    assert nodes.doubt[:, rows[1], 1].max() > 0.25 * sample_preparation.DOUBTFUL
