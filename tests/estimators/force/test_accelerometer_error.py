"""By how much accelerometers err, as what they read at rest tells it."""

import numpy as np
import pytest

from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.force import accelerometer_error
from handscope.estimators.hand.anatomy import CHAINS

SENSORS = ("hand", *CHAINS["thumb"], *CHAINS["index"])


def resting(bias: float, seed: int, seconds: float = 4.0, moving: bool = False) -> Block:
    """Seven sensors held still in two positions, each for so long."""
    rng = np.random.default_rng(seed)
    n = int(100 * seconds)
    t = np.arange(2 * n) / 100
    acc = (
        np.repeat([[0.0, 0.0, 9.80665], [9.80665, 0.0, 0.0]], n, axis=0)[:, None]
        + bias * rng.normal(size=(7, 3))
        + 0.02 * rng.normal(size=(2 * n, 7, 3))
    )
    gyr = 0.003 * rng.normal(size=(2 * n, 7, 3)) + (np.sin(9 * t)[:, None, None] if moving else 0.0)
    return Block(
        Stream("imu", SENSORS, ("gyr", "acc"), 100.0), t, np.concatenate([gyr, acc], axis=2)
    )


@pytest.mark.parametrize("bias", [0.02, 0.05, 0.3])
def test_sensors_at_rest_tell_how_far_they_are_off(bias: float) -> None:
    told = np.array(
        [accelerometer_error.error_sd_at_rest(0.1, [resting(bias, seed)]) for seed in range(20)]
    )
    honest = np.mean(bias**2 / told**2)
    assert 0.1 < honest < 1.4, "never surer than they are"
    assert np.median(told) == pytest.approx(bias, rel=0.25) or bias < np.median(told) < 0.06


def test_who_never_rests_is_taken_to_err_as_is_likely() -> None:
    assert accelerometer_error.error_sd_at_rest(0.1, [resting(0.02, 1, moving=True)]) == 0.1
    assert accelerometer_error.error_sd_at_rest(0.1, []) == 0.1
