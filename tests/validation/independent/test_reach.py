"""A world of its own for the magnet's filter: its physics against closed forms, and one short trial through files to every figure."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.validation.independent import reach as independent_reach
from handscope.validation.independent.reach import COUNTS, FIGURES, Trial
from handscope.validation.independent.simulator import reaching as world
from handscope.validation.reproduce import Wanted


def test_a_rods_field_is_the_closed_form_on_its_axis_and_a_dipoles_far_away() -> None:
    z, up = np.array([0.01, 0.05, 0.2]), np.tile([0.0, 0.0, 1.0], (3, 1))
    ends = [
        (z + s * world.LENGTH / 2) / np.hypot(world.RADIUS, z + s * world.LENGTH / 2)
        for s in (1, -1)
    ]
    on_axis = world.cylinder(z[:, None] * up, up, world.MOMENT)[:, 2]
    np.testing.assert_allclose(on_axis, world.REMANENCE / 2 * (ends[0] - ends[1]), rtol=1e-6)
    r = np.array([[0.1, 0.2, -0.15], [-0.05, 0.3, 0.3], [0.25, 0.0, 0.01]])
    away, m = np.linalg.norm(r, axis=1, keepdims=True), world.MOMENT * up
    dipole = 1e-7 * (3 * r * (r * m).sum(axis=1, keepdims=True) - away**2 * m) / away**5
    np.testing.assert_allclose(
        world.cylinder(r, up, world.MOMENT), dipole, rtol=0.0, atol=1e-3 * np.abs(dipole).max()
    )


def test_faultless_samples_lead_back_to_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    for noise in ("NOISE_GYR", "NOISE_ACC"):
        monkeypatch.setattr(world, noise, 0.0)
    rng = np.random.default_rng(2)
    motion, faulty = world.moving("reaches, trunk leans", rng, 12.0), world.worn(rng, 4)
    perfect = world.Worn(
        ((np.eye(3), np.zeros(3)),) * 4,
        *(getattr(faulty, f) for f in list(world.Worn.__dataclass_fields__)[1:]),
    )
    t, samples = world.inertial(perfect, motion, 1, rng)
    R = motion.at(np.array([t[0] - 1 / world.RATE]))[1][1][0]
    speed = np.zeros(3)
    for sample in samples:
        step = Rotation.from_rotvec(sample[:3] / world.RATE)
        speed += (R * Rotation.from_rotvec(sample[:3] / world.RATE / 2)).apply(
            sample[3:]
        ) / world.RATE - [0.0, 0.0, world.G / world.RATE]
        R = R * step
    (_, p), (_, there) = motion.at(np.array([t[-1] - 1e-3, t[-1]]))
    assert (R.inv() * there[1]).magnitude() < np.radians(0.1)
    np.testing.assert_allclose(speed, np.diff(p, axis=0)[0] / 1e-3, atol=0.01)


def test_a_short_trial_gives_every_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(independent_reach, "COUNTS", {"four": 4})
    found = independent_reach.measure(Trial("reaches, trunk leans", 0, 16.0))
    assert all(math.isfinite(v) for figures in found.values() for v in figures.values())
    assert set(found["four"]) == set(FIGURES) - {"back"}
    assert found["four"]["position"] < 25.0 and found["four"]["unsaid"] == 0.0


def test_every_movement_has_its_row() -> None:
    trials = independent_reach.trials(Wanted(seeds=2))
    figures = dict.fromkeys(FIGURES, 1.0)
    found = independent_reach.finding(
        Wanted(seeds=2), [(t, dict.fromkeys(COUNTS, figures)) for t in trials]
    )
    assert {row.name for row in found.tables[0].rows} == set(world.TRUNKS)
    assert all(v.met for v in found.verdicts)
