"""Compile all kernels to machine code once, in one process: python -m handscope.app.compile_kernels.

Row kernels are compiled without being run, loops when they first run on a machine (numerics/jit.py): each of them runs
here on some seconds of simulated movement. The code is cached; where several processes do the same at once, each
waits for the other (numerics/translation/translation_lock.py).

`--into PACKAGE`, the folder of a handscope that is being built, puts the code into that package (setup.py).
"""

import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numpy as np

from handscope import estimators
from handscope.app.workers import translation
from handscope.app.workers.process import ignore_terminal_signals, stand_back
from handscope.estimators import methods
from handscope.estimators.hand.geometry import sized
from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.tracker import smoother as magnet_smoother
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.numerics.jit import load_kernels
from handscope.estimators.numerics.translation import packaged_code
from handscope.estimators.pipeline.process import process
from handscope.estimators.recording_checks.check import check_processed
from handscope.estimators.simulation import artificial_finger, magnet
from handscope.estimators.simulation.magnetic_field import EARTH, homogeneous
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.wire import stuffing

BEHIND = 10  # of a process's priority


def compile_all() -> None:
    """Compile every row kernel, and run every loop."""
    for module in walk_packages(estimators.__path__, f"{estimators.__name__}."):
        import_module(module.name)
    load_kernels()
    stuffing.unstuff(b"\x01")
    map_method = methods.BATCH["map"]
    trial = artificial_finger.record_trial(np.random.default_rng(0), SensorErrors(), duration=10.0)
    check_processed(process(map_method, map_method.Params(), trial), trial)
    ekf = methods.METHODS["ekf"]
    process(ekf, ekf.Params(), _simulate_pose())
    setup, readings = _simulate_magnet()
    magnet_smoother.smooth(MagnetParams(), magnet_tracker.start(setup), readings)


def _simulate_pose() -> Simulated:
    """The initial pose, for some seconds; a sensor begins to send behind it."""
    rng = np.random.default_rng(0)
    made = simulate(["initial_pose"], "left", sized("left"), rng, SensorErrors())
    block, values = made.samples["imu"], made.samples["imu"].values.copy()
    values[block.t < block.t[-1] - 0.75, -1] = np.nan
    return replace(made, samples={"imu": replace(block, values=values)})


def _simulate_magnet() -> tuple[Setup, Readings]:
    """Setup and two seconds of readings of a magnet."""
    rng = np.random.default_rng(0)
    w, m = magnet.draw_worn(rng), magnet.simulate_condition("both", rng, 2.0)
    imu, mag = (
        magnet.simulate_inertial(w, m, rng),
        magnet.simulate_magnetic(w, m, homogeneous(), rng),
    )
    array = magnet_setup.make_constellation(w.declared_places, w.q_bl)
    setup = Setup(
        array,
        magnet_setup.make_magnet(w.declared_moment, w.declared_lever),
        EARTH,
        None,
        q_bt=m.q_bt[0],
    )
    return setup, Readings(m.t, imu[:, 0], imu[:, 1], mag)


if __name__ == "__main__":
    words = sys.argv[1:]
    if words == ["--behind"]:
        ignore_terminal_signals()
        stand_back(BEHIND)
    compile_all()
    if words[:1] == ["--into"]:
        packaged_code.gather(Path(words[1]))
    else:
        translation.note_kept()
