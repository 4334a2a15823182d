"""All kernels translated to machine code once, by one process, before anybody waits for them: python -m app.translation.

Kernels of rows are translated when their module is imported, loops when they first run on a machine (estimators/numerics/jit.py): each is run here on
some seconds of simulated movement. The code is kept; two processes that translate the same kernel at one moment can keep code that crashes.
"""

import numpy as np

from handscope.estimators import methods
from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.tracker import smoother as magnet_smoother
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.pipeline.process import process
from handscope.estimators.sensors import zero_velocity_detector
from handscope.estimators.simulation import artificial_finger, magnet
from handscope.estimators.simulation.magnetic_field import EARTH, homogeneous
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.wire import stuffing

IMPORTED = (zero_velocity_detector,)  # that nothing below imports


def everything() -> None:
    """Run what is translated on its first call."""
    stuffing.unstuffed(b"\x01")
    calibrates = methods.BATCH["map"]
    process(
        calibrates,
        calibrates.Params(),
        artificial_finger.recorded(np.random.default_rng(0), SensorErrors(), duration=10.0),
    )
    setup, readings = _carried()
    magnet_smoother.smoothed(MagnetParams(), magnet_tracker.start(setup), readings)


def _carried() -> tuple[Setup, Readings]:
    """Two seconds of a magnet."""
    rng = np.random.default_rng(0)
    w, m = magnet.worn(rng), magnet.condition("both", rng, 2.0)
    imu, mag = magnet.inertial(w, m, rng), magnet.magnetic(w, m, homogeneous(), rng)
    array = magnet_setup.constellation(w.told_places, w.q_bl)
    setup = Setup(
        array, magnet_setup.magnet(w.told_moment, w.told_lever), EARTH, None, q_bt=m.q_bt[0]
    )
    return setup, Readings(m.t, imu[:, 0], imu[:, 1], mag)


if __name__ == "__main__":
    everything()
