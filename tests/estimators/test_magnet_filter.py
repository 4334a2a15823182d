"""The filter's derivatives against differences, its time update against a body that truly moves so."""

import numpy as np
import pytest

from estimators import magnet_filter as mf
from estimators import quaternions as quat
from estimators.compiled import looped
from estimators.magnet_tracking import MagnetParams, _sizes
from estimators.quaternions import Array
from estimators.simulation import magnet as sim

RNG = np.random.default_rng(7)
SIZES = _sizes(MagnetParams(gyr_reading="instant"))


@looped
def _stepped(s, x: Array, before: Array, now: Array, dt: float, F: Array) -> Array:  # type: ignore[no-untyped-def]
    return mf.stepped(s, x, before, now, dt, F)


@looped
def _seen(x: Array, place: Array, moment: Array, lever: Array, H: Array, B_m: Array) -> Array:
    return mf.seen(x, place, moment, lever, H, B_m)


@looped
def _moved(x: Array, dx: Array) -> Array:
    return mf.moved(x, dx)


def _state() -> Array:
    x = 0.1 * RNG.normal(size=26)
    x[0:3] = [-0.05, 0.1, 0.2]
    x[mf.XB : mf.XB + 3] = [1e-6, 18e-6, -46e-6]
    for at in (mf.XQ, mf.XGB):
        x[at : at + 4] = quat.normalize(RNG.normal(size=4))
    return x


def _difference(x: Array, other: Array) -> Array:
    """The error (24,) that takes x to the other state."""
    plain = other - x
    turns = (quat.log(quat.relative(x[a : a + 4], other[a : a + 4])) for a in (mf.XQ, mf.XGB))
    th, thg = turns
    return np.concatenate([plain[0:6], th, plain[mf.XB : mf.XB + 9], thg, plain[mf.XBG :]])


def test_slopes_of_the_time_update_are_differences() -> None:
    before, now, dt, h = RNG.normal(size=12), RNG.normal(size=12), 1 / 60, 1e-5
    before[[3, 4, 5, 9, 10, 11]] *= 10
    now[[3, 4, 5, 9, 10, 11]] *= 10
    x, F, other = _state(), np.zeros((24, 24)), np.zeros((24, 24))
    _stepped(SIZES, x, before, now, dt, F)
    for k in range(24):
        dx = np.zeros(24)
        dx[k] = h
        ahead = _stepped(SIZES, _moved(x, dx), before, now, dt, other)
        behind = _stepped(SIZES, _moved(x, -dx), before, now, dt, other)
        # a force in the middle of the sample and a turn over half of it are told to first order in dt
        np.testing.assert_allclose(F[:, k], _difference(behind, ahead) / (2 * h), atol=4e-3)


def test_slopes_of_a_magnetometer_are_differences() -> None:
    place, moment, lever = np.array([-0.1, -0.1, 0.0]), np.array([0.1, -0.2, 0.25]), np.array([0.01, 0.03, 0.0])
    x, H, none, B_m = _state(), np.zeros((3, 24)), np.zeros((3, 24)), np.zeros(3)
    _seen(x, place, moment, lever, H, B_m)
    assert np.linalg.norm(B_m) > 1e-6
    for k in range(24):
        dx = np.zeros(24)
        dx[k] = h = 1e-9 if mf.B_ <= k < mf.BTG else 1e-5
        ahead = _seen(_moved(x, dx), place, moment, lever, none, B_m)
        behind = _seen(_moved(x, -dx), place, moment, lever, none, B_m)
        np.testing.assert_allclose(H[:, k], (ahead - behind) / (2 * h), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("name", sim.CONDITIONS)
def test_a_movement_without_errors_is_followed_by_the_time_update_alone(name: str) -> None:
    """Trunk and hand turn at once: (5.22) as printed, without the trunk's turning, would be off by decimetres after these five seconds."""
    m = sim.condition(name, np.random.default_rng(3), seconds=8.0, rate=240.0)
    samples = np.concatenate([m.w, quat.rotate(quat.conjugate(m.q), m.a + [0, 0, 9.80665])], axis=-1).reshape(len(m.t), 12)
    x, F, k = np.zeros(26), np.zeros((24, 24)), 3 * 240
    x[0:3], x[mf.XQ : mf.XQ + 4], x[mf.XGB : mf.XGB + 4] = m.p_bt[k], m.q_bt[k], m.q[k, 0]
    R = quat.conjugate(m.q[k, 0])
    x[3:6] = quat.rotate(R, ((m.p[k + 1] - m.p[k - 1]) @ np.eye(3))[1] - (m.p[k + 1] - m.p[k - 1])[0]) * 120.0
    for i in range(k + 1, len(m.t)):
        x = _stepped(SIZES, x, samples[i - 1], samples[i], 1 / 240, F)
    assert np.linalg.norm(x[0:3] - m.p_bt[-1]) < 2e-3
    assert np.degrees(quat.angle(quat.relative(x[mf.XQ : mf.XQ + 4], m.q_bt[-1]))) < 0.05
