"""A squeeze from the readings to the stiffness; how what is held answers to frequencies; work."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import ForceFlag, Trajectory
from handscope.estimators.force import frequency_response, load_exchange
from handscope.estimators.hand.anatomy import FLEXION, JOINT
from handscope.estimators.measures import object_frame, squeeze
from handscope.estimators.measures.figure import Figure
from handscope.estimators.simulation.movements import object_dynamics
from handscope.estimators.simulation.movements.object_dynamics import Mishap
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.force.lifted import done, followed
from tests.schedule import swept


@cache
def spring(seed: int) -> tuple[Simulated, np.ndarray]:
    """0.6 N/mm, squeezed eight times."""
    return done(seed, object_dynamics.squeeze, stiffness=600.0)


@cache
def spring_moved(seed: int) -> Trajectory:
    return followed(spring(seed)[0]).trajectory


def figures(made: Simulated, moved: Trajectory | None = None) -> dict[str, Figure]:
    event = next(e for e in made.events if e.trial_type == "task")
    found = squeeze.measure(
        squeeze.Params(), moved or followed(made).trajectory, event.onset, event.end, made.geometry
    )
    return {f.name: f for f in squeeze.figures(found)}


@pytest.mark.parametrize("trials", swept([3, 6], kept=[3]))
def test_stiffness_is_near_the_truth_and_as_sure_as_it_says(trials: int) -> None:
    off, surprise = [], []
    for seed in range(trials):
        (made, true), moved = spring(seed), spring_moved(seed)
        f = figures(made, moved)
        assert f["squeeze_count"].value == 8
        assert f["squeeze_rate"].value == pytest.approx(1 / 1.2, rel=0.02)
        push = np.linalg.norm(true[:, 0], axis=1)
        assert f["squeeze_force"].value < push.max() * 1.1
        K = f["squeeze_stiffness"]
        assert K.sd
        off.append(abs(K.value / 600 - 1))
        surprise.append(((K.value - 600) / K.sd) ** 2)
        assert f["squeeze_damping"].value == pytest.approx(
            0.0, abs=3 * (f["squeeze_damping"].sd or 0.0)
        )
        assert f["squeeze_coherence"].value > 0.95
        assert 0.7 < f["squeeze_force_bandwidth"].value < 6.0  # squeezed every 1.2 s, read at 12 Hz
        assert all(
            np.isfinite(one.value) for one in f.values()
        )  # a spring answers as far as it is pushed: that is no figure that lacks
    so_far = object_frame.squeezed_stiffness(
        moved.between(0.0, made.events[-1].onset + 7.0), made.geometry
    )
    assert so_far is not None and so_far.value[-1] == pytest.approx(600.0, abs=2.5 * so_far.sd[-1])
    assert so_far.sd[-1] < 120.0
    assert np.mean(off) < 0.08
    assert np.mean(surprise) < 2.5


@cache
def damped() -> tuple[Simulated, Trajectory]:
    made, _ = done(1, object_dynamics.squeeze, stiffness=400.0, damping=60.0)
    return made, followed(made).trajectory


def test_a_damper_is_told_from_a_spring() -> None:
    f = figures(*damped())
    assert f["squeeze_damping"].value == pytest.approx(
        60.0, abs=2.5 * (f["squeeze_damping"].sd or 0.0)
    )
    assert f["squeeze_stiffness"].value == pytest.approx(400.0, rel=0.2)
    assert f["squeeze_stiffness"].reason == ""
    assert f["squeeze_lag"].category == "holds", "a damper takes energy up"
    assert f["squeeze_lag"].value == pytest.approx(60.0 / 400.0, rel=0.5)


def untold(f: dict[str, Figure]) -> set[str]:
    return {name for name, one in f.items() if np.isnan(one.value)}


def test_what_seems_to_give_energy_back_has_no_damping() -> None:
    """Forces that come later by 0.25 s: the object seems to move first."""
    made, moved = damped()
    assert moved.forces is not None
    f = figures(made, replace(moved, forces=np.roll(moved.forces, 25, axis=0)))
    assert "energy came out" in f["squeeze_stiffness"].reason
    assert untold(f) == {"squeeze_damping", "squeeze_work"}
    assert f["squeeze_lag"].category == "fails"
    assert f["squeeze_lag"].value < -2 * (f["squeeze_lag"].sd or 0.0)


def test_the_conditions_are_told_with_what_decides_them_and_the_answer_with_its_band() -> None:
    (made, _), moved = spring(0), spring_moved(0)
    event = next(e for e in made.events if e.trial_type == "task")
    f = figures(made, moved)
    told = {
        name: f[name].category
        for name in ("squeeze_coherence", "squeeze_force_bandwidth", "squeeze_lag")
    }
    assert told == {
        "squeeze_coherence": "nothing speaks against it",
        "squeeze_force_bandwidth": "cannot be told",  # a spring answers as far up as it is pushed
        "squeeze_lag": "nothing speaks against it",  # and neither takes energy up nor gives any
    }
    found = squeeze.measure(squeeze.Params(), moved, event.onset, event.end, made.geometry)
    curves = {c.name: c for c in squeeze.shown(found).curves}
    size, low, high = (curves[f"squeeze_response{which}"].y for which in ("", "_low", "_high"))
    np.testing.assert_array_less(low, 1 / 600)
    np.testing.assert_array_less(1 / 600, high)
    assert (high > 1.05 * size).all(), "the scales' error is in it"
    low, high = (curves[f"squeeze_phase{which}"].y for which in ("_low", "_high"))
    assert (low < 0).all() and (high > 0).all()
    assert curves["squeeze_coherence"].x_unit == "Hz"
    short = {
        one.name: one
        for one in squeeze.figures(
            squeeze.measure(squeeze.Params(), moved, event.onset, event.onset + 7.0, made.geometry)
        )
    }
    assert np.isnan(short["squeeze_coherence"].value)
    assert "too short a time" in short["squeeze_coherence"].reason
    assert short["squeeze_stiffness"].reason == ""


def test_forces_that_were_not_read_have_no_tops() -> None:
    made, moved = damped()
    assert moved.force_flags is not None
    full = replace(moved, force_flags=moved.force_flags | np.uint8(ForceFlag.SATURATED))
    assert {"squeeze_force", "squeeze_work", "squeeze_stiffness", "thumb_squeeze_share"} <= untold(
        figures(made, full)
    )


def test_with_a_third_finger_no_stiffness_is_told() -> None:
    made, _ = done(2, object_dynamics.squeeze, mishap=Mishap(third=0.4))
    K = figures(made)["squeeze_stiffness"]
    assert np.isnan(K.value)
    assert K.grade == "poor"
    assert "forces do not balance" in K.reason


def test_a_third_finger_that_takes_a_fifth_makes_the_stiffness_as_unsure_as_it_is_wrong() -> None:
    made, _ = done(5, object_dynamics.squeeze, mishap=Mishap(third=0.2))
    K = figures(made)["squeeze_stiffness"]
    assert "another finger or something else" in K.reason
    assert K.sd
    assert K.value == pytest.approx(600.0, abs=2.5 * K.sd)
    assert K.sd / K.value > 0.1


def test_a_sensor_that_saturates_softly_bends_the_force_over_the_distance_and_that_is_said() -> (
    None
):
    made, _ = spring(5)
    block = made.samples["force"]
    soft = replace(
        made,
        samples={
            **made.samples,
            "force": Block(block.stream, block.t, 6.0 * np.tanh(block.values / 6.0)),
        },
    )
    K = figures(soft)["squeeze_stiffness"]
    assert "the force does not grow evenly with the distance" in K.reason
    assert K.sd
    assert K.value == pytest.approx(600.0, abs=2.5 * K.sd)


def test_the_answer_of_a_mass_on_a_spring_and_a_damper() -> None:
    rate, n = 100.0, 20_000
    rng = np.random.default_rng(3)
    u, x, v = rng.normal(size=n), np.zeros(n), 0.0
    M, D, K = 0.3, 4.0, 600.0
    for k in range(1, n):  # exact enough with ten steps a sample
        x[k] = x[k - 1]
        for _ in range(10):
            v += 0.1 / rate * (u[k - 1] - D * v - K * x[k]) / M
            x[k] += 0.1 / rate * v
    found = frequency_response.estimate_response(np.arange(n) / rate, u, x, length=8.0)
    near = (found.frequency > 1.0) & (found.frequency < 12.0)
    s = 2j * np.pi * found.frequency[near]
    hold = np.exp(-s / (2 * rate))  # the force is held for a sample
    truth = hold / (M * s**2 + D * s + K)
    assert found.coherence[near].min() > 0.9
    assert np.median(np.abs(found.P[near] / truth - 1)) < 0.05
    off = np.abs(np.abs(found.P[near]) - np.abs(truth)) / found.sd[near]
    assert 0.3 < np.mean(off < 2) <= 1.0
    told = frequency_response.check_conditions(found)
    assert (told.independent, told.wide, told.passive) == (True, True, True)
    assert told.load_bandwidth == pytest.approx(np.sqrt(K / M) / (2 * np.pi) * 1.5, rel=0.25)


def test_what_the_data_do_not_bear_out_is_told() -> None:
    rng, t = np.random.default_rng(0), np.arange(6000) / 100
    u = np.convolve(rng.normal(size=6000), np.ones(20) / 20, "same")
    pushed_elsewhere = frequency_response.check_conditions(
        frequency_response.estimate_response(
            t, u, u / 600 + 2e-3 * np.convolve(rng.normal(size=6000), np.ones(20) / 20, "same")
        )
    )
    assert pushed_elsewhere.independent is False
    ahead = frequency_response.check_conditions(
        frequency_response.estimate_response(t, u, np.roll(u, -8) / 600)
    )  # the object moves first
    assert ahead.passive is False
    assert len(ahead.reasons) == 1
    short = frequency_response.check_conditions(
        frequency_response.estimate_response(t[:400], u[:400], u[:400] / 600)
    )
    assert (short.independent, short.wide, short.passive) == (None, None, None)


def test_power_and_work_of_lifting_and_of_turning() -> None:
    t = np.linspace(0.0, 2.0, 201)
    forces, v = np.tile([[[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]]], (201, 1, 1)), np.zeros((201, 2, 3))
    v[:, :, 2] = (0.25 * (1 - np.cos(np.pi * t)))[:, None]
    assert load_exchange.integrate_power(t, load_exchange.exchange_power(forces, v))[
        -1
    ] == pytest.approx(4.0 * 0.5, rel=1e-4)
    turn = np.tile([[[0.2, 0.0, 0.0], [0.0, 0.0, 0.0]]], (201, 1, 1))
    assert load_exchange.integrate_power(
        t, load_exchange.exchange_power(forces, v * 0, turn, turn * 0 + 3.0)
    )[-1] == pytest.approx(0.2 * 3.0 * 2.0)


def test_a_joint_beyond_the_model_is_said_and_the_stiffness_is_less_sure() -> None:
    """A thumb whose last joint hyperextends: the model holds it at -20 deg."""
    made, moved = spring(0)[0], spring_moved(0)
    angles = moved.angles.copy()
    angles[:, JOINT["thumb_ip"], FLEXION] = np.radians(-20.0)
    usual, beyond = (
        figures(made, moved)["squeeze_stiffness"],
        figures(made, replace(moved, angles=angles))["squeeze_stiffness"],
    )
    assert "a joint bends further than it may" not in usual.reason
    assert "a joint bends further than it may" in beyond.reason
    assert usual.sd and beyond.sd and beyond.sd > 1.3 * usual.sd
    assert beyond.value == usual.value
