"""The compiled loop against the same code in plain Python, by which other tests judge its parts."""

from dataclasses import fields

import numpy as np
import pytest

from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.tracker import tracker as tracking
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings, Track
from handscope.estimators.magnet.tracker.update_cycle import run_filter
from handscope.estimators.simulation import magnet as sim
from handscope.estimators.simulation.magnetic_field import EARTH, homogeneous
from tests.estimators.interpreted import interpreted

PARAMS = MagnetParams()


def _readings() -> tuple[Setup, Readings]:
    """Four samples of a hand that is searched for at the first; the last follows a gap."""
    rng = np.random.default_rng(4)
    worn, m = sim.draw_worn(rng, places=sim.PLATE[:2]), sim.simulate_condition("both", rng, 1.5)
    imu = sim.simulate_inertial(worn, m, rng)
    mag = sim.simulate_magnetic(worn, m, homogeneous(), rng)
    setup = Setup(
        magnet_setup.make_constellation(worn.declared_places, worn.q_bl),
        magnet_setup.make_magnet(worn.declared_moment, worn.declared_lever),
        EARTH,
    )
    kept = [0, 1, 2, 40]
    mag[1, 1] = imu[2, 1, 0] = np.nan
    return setup, Readings(m.t[kept], imu[kept, 0], imu[kept, 1], mag[kept])


def test_the_compiled_loop_does_what_its_python_says(monkeypatch: pytest.MonkeyPatch) -> None:
    setup, readings = _readings()
    state, track = tracking.step(PARAMS, tracking.start(setup), readings)
    monkeypatch.setattr(tracking, "run_filter", interpreted(run_filter))
    plain_state, plain = tracking.step(PARAMS, tracking.start(setup), readings)
    assert state.x is not None and plain_state.x is not None
    np.testing.assert_allclose(state.x, plain_state.x, rtol=1e-9, atol=1e-12)
    for f in fields(Track):
        np.testing.assert_allclose(
            getattr(track, f.name), getattr(plain, f.name), rtol=1e-7, atol=1e-12, err_msg=f.name
        )
