"""Objects in the fingers and magnets before boards, by simulators of their own: they share nothing with the program, obey physics, and what is wrong is counted."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.validation.independent import grasp as independent_grasp
from handscope.validation.independent import magnetometer_array, simulator
from handscope.validation.independent.simulator import board, force_sensors, pinch
from handscope.validation.reproduce import Wanted
from tests.test_architecture import imports

STANDARD = {name for name in sys.stdlib_module_names if name != "__main__"}


def test_they_import_numpy_scipy_and_each_other_alone() -> None:
    for path in Path(simulator.__file__).parent.glob("*.py"):
        found = {
            name
            for name in imports(path.read_text(), "handscope.validation.independent.simulator")
            if not name.startswith("handscope.validation.independent.simulator")
        }
        assert {name.partition(".")[0] for name in found} <= STANDARD | {"numpy", "scipy"}, (
            path.name
        )


def test_what_is_carried_weighs_and_what_sensors_without_errors_tell_is_what_fingers_do() -> None:
    held = pinch.Held(mass=0.3)
    done = pinch.pinched(held, "right", np.random.default_rng(3))
    aloft = int(11.0 * pinch.RATE)  # held in the air, all but still
    np.testing.assert_allclose(
        done.forces[aloft].sum(axis=0), [0, 0, 0.3 * pinch.GRAVITY], atol=0.1
    )
    still = force_sensors.Sensor(np.eye(3), Rotation.identity(), np.zeros(3))
    exact = force_sensors.Cuffs(rate=100.0, walk=0.0, noise=0.0)
    t, felt = force_sensors.simulate_readings(done, exact, [still, still], np.random.default_rng(0))
    rows = np.round(t * pinch.RATE).astype(int)
    for k in range(2):
        np.testing.assert_allclose(
            done.q[k][rows].apply(felt[:, k]), done.forces[rows, k], atol=1e-9
        )


def test_fields_have_no_divergence_and_a_short_rod_is_a_dipole() -> None:
    place, moment, at, h = (
        np.zeros((1, 3)),
        np.array([[0.1, 0.3, -0.2]]),
        np.array([0.06, -0.02, 0.09]),
        1e-5,
    )
    for field in (board.dipole, lambda p, m, a: board.rod(p, m, 0.04, a)):
        slopes = [
            (field(place, moment, (at + step)[None]) - field(place, moment, (at - step)[None]))[
                0, 0
            ]
            for step in h * np.eye(3)
        ]
        assert abs(np.trace(slopes)) < 1e-4 * np.abs(slopes).max()
        np.testing.assert_allclose(slopes, np.transpose(slopes), atol=1e-4 * np.abs(slopes).max())
    np.testing.assert_allclose(
        board.rod(place, moment, 1e-4, at[None]), board.dipole(place, moment, at[None]), rtol=1e-4
    )


def test_one_trial_of_each_goes_through_files_and_commands() -> None:
    told = independent_grasp.measure(independent_grasp.Trial("lift", "12 Hz, calibrated", 1))[
        "lift_mass"
    ]
    assert told.known and abs(told.value / told.true - 1) < 0.15 and not told.has_reason
    found = magnetometer_array.measure(magnetometer_array.Trial("moment told", 9, 1))
    assert len(found.off) > 0.5 * found.readings and np.median(found.off) < 0.003


def test_what_is_confident_and_wrong_is_counted() -> None:
    of_grasp = independent_grasp.trials(Wanted(seeds=1))
    usual = {
        "lift_mass": (0.5, 0.02, 0.5, False),
        "squeeze_stiffness": (600.0, 20.0, 600.0, False),
        "squeeze_damping": (1.0, 2.0, 0.0, False),
    }
    results = [
        (
            t,
            {
                q: independent_grasp.ReportedFigure(*usual[q])
                for q in independent_grasp.QUANTITIES[t.task]
            },
        )
        for t in of_grasp
    ]
    results[0] = (
        of_grasp[0],
        {"lift_mass": independent_grasp.ReportedFigure(0.6, 0.02, 0.5, False)},
    )
    results[1] = (
        of_grasp[1],
        {"lift_mass": independent_grasp.ReportedFigure(0.6, 0.02, 0.5, True)},
    )
    said = independent_grasp.finding(Wanted(seeds=1), results)
    first, second = said.tables[0].rows[:2]
    assert (
        first.ours["surely wrong, %"].mean == 100.0 and second.ours["surely wrong, %"].mean == 0.0
    )
    assert first.ours["error, %"].mean == pytest.approx(20.0)
    assert f"1 of {len(of_grasp)}" in said.remarks[0] and of_grasp[0].condition in said.remarks[0]
    of_array = magnetometer_array.trials(Wanted(seeds=1))
    off, sd = np.array([0.001, 0.009]), np.array([0.002, 0.002])
    rows = [(t, magnetometer_array.LocatedReadings(4, off, sd, (off / sd) ** 2)) for t in of_array]
    row = magnetometer_array.finding(Wanted(seeds=1), rows).tables[0].rows[0]
    assert row.ours["found, %"].mean == 50.0 and row.ours["surely wrong, %"].mean == 25.0
