"""A lift from the readings to the mass: near the truth, as sure as it says, and never sure of what went wrong."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import FORCE, TORQUE, Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.force import fingertip_forces
from handscope.estimators.force.fingertip_forces import ForceParams
from handscope.estimators.force.grasp_phases import GraspPhase
from handscope.estimators.measures import lift, object_frame
from handscope.estimators.measures.lift import Lift
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.movements.object_dynamics import Mishap
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.force.lifted import done, followed
from tests.schedule import swept

Change = Callable[[Array, Array], Array]


def measured(made: Simulated, moved: Trajectory | None = None) -> Lift:
    event = next(e for e in made.events if e.trial_type == "task")
    return lift.measure(lift.Params(), moved or followed(made).trajectory, event.onset, event.end)


def changed(made: Simulated, change: Change, told: bool = True) -> Simulated:
    """The readings (n, 2, 3) of the force sensors, thumb first, made wrong; times are those since the task's beginning."""
    block: Block = made.samples["force"]
    onset = next(e.onset for e in made.events if e.trial_type == "task")
    stream = block.stream if told else replace(block.stream, full_scale={})
    spoilt = Block(stream, block.t, change(block.t - onset, block.values.copy()))
    return replace(made, samples={**made.samples, "force": spoilt})


@pytest.mark.parametrize("trials", swept([4, 8], kept=[4]))
def test_mass_and_forces_are_near_the_truth_and_as_sure_as_they_say(trials: int) -> None:
    off, surprise, of_forces = [], [], []
    for seed in range(trials):
        made, true = done(seed, mass=0.28 if seed % 2 else 0.44)
        moved = followed(made).trajectory
        event = next(e for e in made.events if e.trial_type == "task")
        (one,) = lift.measure(lift.Params(), moved, event.onset, event.end).lifts
        mass = 0.28 if seed % 2 else 0.44
        off.append(abs(one.mass / mass - 1))
        surprise.append(((one.mass - mass) / one.mass_sd) ** 2)
        assert moved.forces is not None and moved.forces_sd is not None
        of_forces.append(np.nanmean(((moved.forces - true) / moved.forces_sd)[:, :2] ** 2))
        assert one.held.height.max() == pytest.approx(0.5, abs=0.08)  # the arm sways by up to 6 cm
    assert np.mean(off) < 0.06
    assert 0.2 < np.mean(surprise) < 2.0
    assert 0.2 < np.mean(of_forces) < 1.5


def without_forces(moved: Trajectory) -> Trajectory:
    """As it is before forces are attached."""
    return replace(
        moved,
        forces=None,
        forces_sd=None,
        force_flags=None,
        lifting=None,
        torques=None,
        torques_sd=None,
    )


@cache
def usual() -> tuple[Simulated, Processed]:
    """0.44 kg."""
    made, _ = done(0, mass=0.44)
    return made, followed(made)


@cache
def heavy() -> tuple[Simulated, Array]:
    """0.44 kg off the table from 0.8 s of the task on, for five seconds; the force sensors have six axes."""
    return done(3, mass=0.44, six_axes=True)


@cache
def heavy_moved() -> Processed:
    return followed(heavy()[0])


def test_forces_for_the_eye_are_near_the_truth_at_once() -> None:
    (made, true), moved = heavy(), heavy_moved()
    onset = next(e.onset for e in made.events if e.trial_type == "task")
    held = onset + 4.0
    before = [b.between(onset - 4.0, held) for b in made.blocks()]
    rows = moved.trajectory.between(held - 0.5, held)
    zeros = fingertip_forces.estimate_zeros(ForceParams(), before)
    told = fingertip_forces.newest_forces(zeros, rows, before, made.mounting, moved.calibrations)
    expected = true[np.searchsorted(made.truth.t, held)]
    assert np.linalg.norm(expected[:2], axis=1).min() > 2.0  # N
    assert (
        np.linalg.norm(told[:2] - expected[:2], axis=1).max()
        < 0.15 * np.linalg.norm(expected[:2], axis=1).max()
    )
    assert np.isnan(told[2:]).all()  # fingers without a force sensor


def test_torques_are_those_of_the_forces_at_the_places_that_are_touched() -> None:
    """M = r x F with r fixed in each sensor: no part along the force, and as large as the lever makes it; as sure as they say."""
    (made, _), moved = heavy(), heavy_moved().trajectory
    (one,) = measured(made, moved).lifts
    held = (moved.t > one.held.t[one.off][0]) & (moved.t < one.held.t[one.off][-1])
    assert moved.forces is not None and moved.torques is not None and moved.torques_sd is not None
    F, M, sd = (v[held][:, :2] for v in (moved.forces, moved.torques, moved.torques_sd))
    along = (M * F).sum(axis=2) / np.linalg.norm(F, axis=2)
    assert 0.1 < np.mean((along / np.sqrt((sd**2).mean(axis=2))) ** 2) < 2.0
    lever = np.linalg.norm(M, axis=2) / np.linalg.norm(F, axis=2)
    true = np.linalg.norm(
        made.samples["force"].of(TORQUE) - made.samples["force"].of(TORQUE)[:6].mean(axis=0), axis=2
    ).max(axis=0)
    assert np.linalg.norm(M, axis=2).max(axis=0) == pytest.approx(true, rel=0.15)
    assert (lever.std(axis=0) < 0.5e-3).all()
    assert np.isnan(moved.torques[:, 2:]).all()
    assert one.held.twist is not None and one.held.twist_sd is not None
    assert 0.1 < np.mean((one.held.twist / one.held.twist_sd)[one.off] ** 2) < 2.0  # nothing twists
    drawn = {c.name: c for c in lift.shown(measured(made, moved)).curves}
    np.testing.assert_array_equal(drawn["torque_index"].y[:-1], one.held.twist[:, 1])
    assert np.nanmin(drawn["torque_thumb_high"].y - drawn["torque_thumb_low"].y) > 0
    f = {x.what: x for x in lift.figures(measured(made, moved))}
    assert abs(f["lift_work_turning"].value) < 0.02 * f["lift_work"].value


def test_grip_and_load_are_as_unsure_as_the_push_of_one_side_lacks() -> None:
    (made, _), good = heavy(), heavy_moved().trajectory
    assert good.forces is not None
    less = replace(
        good, forces=good.forces * np.array([0.8, 1.0, 1.0, 1.0, 1.0])[:, None]
    )  # the thumb's sensor tells a fifth too little
    was, now = ({f.what: f for f in lift.figures(measured(made, moved))} for moved in (good, less))
    for what in ("lift_grip_hold", "lift_load_hold", "lift_grip_over_load"):
        assert abs(now[what].value - was[what].value) < 1.2 * (now[what].sd or 0.0)


def test_no_mass_is_told_of_what_weighs_nothing() -> None:
    (made, _), good = heavy(), heavy_moved().trajectory
    assert good.forces is not None
    thumb, index = good.forces[:, 0], good.forces[:, 1]
    found = measured(
        made,
        replace(
            good,
            forces=np.concatenate(
                [index[:, None] * -0.99 + 0.01 * thumb[:, None], good.forces[:, 1:]], axis=1
            ),
        ),
    )
    assert "hardly weighs anything" in found.reason and np.isnan(found.lifts[0].mass)


def held_up(
    support: float, swing: float, noise: float = 0.07, alike: float = 0.02, poured: float = 0.0
) -> GraspPhase:
    """0.2 kg between two fingers for five seconds, raised and lowered meanwhile; something else pushes up by so many N, so many kg are added in two."""
    t, rng = np.arange(0.0, 5.0, 0.08), np.random.default_rng(5)
    lifting = np.stack([0 * t, 0 * t, GRAVITY + swing * np.sin(2 * np.pi * 0.4 * t)], axis=1)
    push = np.array([3.0, 0.0, 0.0])
    mass = 0.2 + poured * np.clip(0.5 * (t - 1.5), 0.0, 1.0)
    forces = np.stack(
        [0.5 * (mass[:, None] * lifting - [0.0, 0.0, support]) + side * push for side in (1, -1)],
        axis=1,
    )
    forces += noise / np.sqrt(2) * rng.normal(size=forces.shape)
    axis, sd = np.tile([1.0, 0.0, 0.0], (len(t), 1)), np.full(forces.shape, alike)
    return GraspPhase(
        t,
        ("thumb", "index"),
        forces,
        np.hypot(sd, noise),
        sd,
        lifting,
        axis,
        0 * t,
        0 * t,
        0 * t,
        np.zeros((len(t), 2), np.uint8),
    )


def test_what_else_carries_the_object_shows_where_the_load_does_not_follow_the_acceleration() -> (
    None
):
    def weighed(h: GraspPhase) -> lift.MassEstimate:
        return lift.estimate_mass(lift.Params(), h, np.ones(len(h.t), bool))

    alone, shared, hidden = (
        weighed(held_up(0.0, 1.0)),
        weighed(held_up(0.45, 1.0)),
        weighed(held_up(0.45, 0.05)),
    )
    assert alone.supported < lift.Params().perhaps < shared.supported
    assert weighed(held_up(0.8, 1.0)).supported > lift.Params().constant
    assert hidden.supported < lift.Params().perhaps, (
        "who holds still cannot tell it from a lighter object"
    )
    for one, mass in ((alone, 0.2), (shared, 0.2), (hidden, 0.2 - 0.45 / GRAVITY)):
        assert one.mass == pytest.approx(mass, abs=2 * one.sd)
    assert alone.sd < 0.02 * 0.2 + np.sqrt(2) * 0.02 / GRAVITY, (
        "noise of many samples is averaged out"
    )
    assert shared.sd > 5 * alone.sd


def test_what_is_added_while_it_is_held_up_shows_as_a_mass_that_grows() -> None:
    p = lift.Params()
    same, more, much, less = (
        lift.estimate_mass(p, h, np.ones(len(h.t), bool))
        for h in (held_up(0.0, 0.3, poured=kg) for kg in (0.0, 0.008, 0.06, -0.06))
    )
    assert same.changed < p.perhaps < more.changed < p.constant < min(much.changed, less.changed)
    assert more.mass - 2 * more.sd < 0.2 and more.mass + 2 * more.sd > 0.208, "any of those it had"
    np.testing.assert_allclose(np.ptp(much.weight), 0.06 * GRAVITY, rtol=0.5)


def test_no_mass_is_told_of_what_becomes_heavier_in_mid_air() -> None:
    made, _ = done(0, mass=0.44)
    found = measured(
        changed(made, lambda t, v: v * (1 + 0.3 * np.clip((t - 2.5) / 2, 0.0, 1.0))[:, None, None])
    )
    assert found.grade == "poor"
    assert "the load changed while the object was held up" in found.reason
    assert np.isnan(found.lifts[0].mass)


def test_forces_and_mass_are_as_sure_as_the_sensors_are_calibrated() -> None:
    (made, _), good = heavy(), heavy_moved().trajectory
    bare = without_forces(good)
    force, others = made.samples["force"], [b for n, b in made.samples.items() if n != "force"]
    sds = []
    for share in (0.005, 0.1):
        known = replace(force.stream, scale_sd=dict.fromkeys(force.stream.sensors, share))
        blocks = [replace(force, stream=known), *others]
        moved, _ = fingertip_forces.attach_forces(
            ForceParams(), bare, blocks, {}, heavy_moved().calibrations
        )
        assert moved.force_scale_sd is not None
        np.testing.assert_array_equal(moved.force_scale_sd[0, :3], [share, share, np.nan])
        (one,) = measured(made, moved).lifts
        assert one.held.squeeze_scale_sd == pytest.approx(share / np.sqrt(2))
        sds.append(one.mass_sd)
    (usual,) = measured(made, good).lifts
    assert sds[0] < usual.mass_sd < sds[1]
    assert sds[1] > 0.4 * 0.1 * 0.44 / np.sqrt(2), (
        "both fingers carry half of it each, and err apart"
    )
    held = replace(force.stream, turn_sd=dict.fromkeys(force.stream.sensors, 0.005))
    drawn = {
        "thumb_tip_force": np.array([0.0, 1.0, 0.0, 0.0])
    }  # does not count: the forces are in the inertial sensor's axes
    moved, _ = fingertip_forces.attach_forces(
        ForceParams(),
        bare,
        [replace(force, stream=held), *others],
        drawn,
        heavy_moved().calibrations,
    )
    (straight,) = measured(made, moved).lifts
    assert straight.mass == pytest.approx(usual.mass, rel=0.02)
    assert straight.mass_sd < 0.95 * usual.mass_sd, "how the cuff holds the sensor is known"
    assert good.force_scale_sd is None
    assert usual.held.squeeze_scale_sd is None


@pytest.mark.parametrize(
    "told", [True, False], ids=["at a limit that is told", "at a limit that nobody told"]
)
def test_clipped_torques_are_not_told_and_tell_no_work(told: bool) -> None:
    (made, _), good = heavy(), heavy_moved().trajectory
    assert good.torques is not None
    force, limit = made.samples["force"], 6e-3  # Nm
    values = np.concatenate(
        [force.values[..., :3], np.clip(force.values[..., 3:], -limit, limit)], axis=2
    )
    assert np.abs(force.values[..., 3:]).max() > 1.5 * limit
    block = Block(
        replace(force.stream, full_scale={TORQUE: limit} if told else {}), force.t, values
    )
    blocks = [block, *(b for n, b in made.samples.items() if n != "force")]
    bare = without_forces(good)
    moved, _ = fingertip_forces.attach_forces(
        ForceParams(), bare, blocks, {}, heavy_moved().calibrations
    )
    assert moved.torques is not None and moved.torques_sd is not None
    clipped = (
        np.linalg.norm(good.torques, axis=2) > 9.5e-3
    )  # Nm: the other axes of the thumb's reach 6
    assert clipped.any() and np.isnan(moved.torques[clipped]).all()
    assert not [
        f
        for f in lift.figures(measured(made, moved))
        if f.what == "lift_work_turning" and np.isfinite(f.value)
    ]


@pytest.mark.parametrize(
    ("change", "said", "left"),
    [
        (lambda v: v[..., 3:], "torques without forces of the same fingertip", False),
        (
            lambda v: np.concatenate([v[..., :3], 1e6 * v[..., 3:]], axis=2),
            "torques that no fingertip exerts",
            False,
        ),
        (lambda v: np.concatenate([v[..., :3], np.nan * v[..., 3:]], axis=2), "", False),
        (
            lambda v: np.where(
                (np.arange(len(v)) % 5 == 0)[:, None, None] & (np.arange(6) > 2), np.nan, v
            ),
            "",
            True,
        ),
    ],
    ids=["without a force", "in another unit", "missing throughout", "missing now and then"],
)
def test_torques_that_cannot_be_used_are_not_told_and_leave_the_forces_as_they_are(
    change: Callable[[Array], Array], said: str, left: bool
) -> None:
    (made, _), good = heavy(), heavy_moved().trajectory
    force = made.samples["force"]
    values = change(force.values)
    quantities = (FORCE, TORQUE)[-values.shape[2] // 3 :]
    block = Block(replace(force.stream, quantities=quantities, full_scale={}), force.t, values)
    bare = without_forces(good)
    blocks = [block, *(b for n, b in made.samples.items() if n != "force")]
    moved, words = fingertip_forces.attach_forces(
        ForceParams(), bare, blocks, {}, heavy_moved().calibrations
    )
    assert (moved.torques is not None) == left
    assert not said or any(said in w for w in words)
    if FORCE in quantities:
        np.testing.assert_array_equal(moved.forces, good.forces)


def test_figures_tell_the_phases_and_shares() -> None:
    made, true = heavy()
    f = {figure.name: figure for figure in lift.figures(measured(made, heavy_moved().trajectory))}
    assert f["lift_count"].value == 1
    assert f["lift_load_hold"].value == pytest.approx(0.44 * 9.81, rel=0.08)
    assert f["lift_grip_hold"].value == pytest.approx(
        np.linalg.norm(true[len(true) // 2 + 200, 0] - true[len(true) // 2 + 200, 1]) / 2, rel=0.25
    )
    assert f["lift_time_to_lift"].value == pytest.approx(0.8, abs=0.15)
    assert f["lift_time_held"].value == pytest.approx(5.0, abs=0.25)
    assert f["thumb_force_share"].value + f["index_force_share"].value == pytest.approx(1.0)
    assert f["lift_work"].value == pytest.approx(0.44 * 9.81 * f["lift_height"].value, rel=0.08)


def test_work_is_done_against_gravity_and_inertia_in_all_directions() -> None:
    """0.5 kg carried up by 0.4 m and thrown aside: m g h + m v^2 / 2, whichever finger pushes how."""
    t = np.linspace(0.0, 1.0, 201)
    place = np.stack([0.3 * t**3, -0.1 * t**2, 0.4 * t**2 * (3 - 2 * t)], axis=1)
    velocity = np.stack([0.9 * t**2, -0.2 * t, 2.4 * t * (1 - t)], axis=1)
    lifting = np.stack([1.8 * t, np.full(len(t), -0.2), 2.4 - 4.8 * t + GRAVITY], axis=1)
    push = np.stack([np.sin(5 * t), 6 + t, np.cos(3 * t)], axis=1)
    forces = np.stack([0.3 * 0.5 * lifting + push, 0.7 * 0.5 * lifting - push], axis=1)
    flags = np.zeros((len(t), 2), np.uint8)
    h = GraspPhase(
        t,
        ("thumb", "index"),
        forces,
        0 * forces,
        0 * forces,
        lifting,
        0 * place,
        0 * t,
        velocity[:, 2],
        place[:, 2],
        flags,
        velocity=velocity,
    )
    expected = 0.5 * GRAVITY * 0.4 + 0.5 * 0.5 * (0.9**2 + 0.2**2)
    assert lift.lifting_work(h, np.ones(len(t), bool)) == pytest.approx(expected, rel=1e-4)


def test_while_it_is_held_up_the_mass_is_told_so_far_and_its_curve_ends_where_the_figure_does() -> (
    None
):
    (made, _), moved = heavy(), heavy_moved().trajectory
    event = next(e for e in made.events if e.trial_type == "task")
    assert (
        object_frame.lifted_mass(moved.between(0.0, event.onset + 0.8), made.geometry) is None
    )  # still on the table
    so_far = object_frame.lifted_mass(moved.between(0.0, event.onset + 3.8), made.geometry)
    assert so_far is not None
    assert so_far.t[-1] == pytest.approx(event.onset + 3.8, abs=0.05)
    assert so_far.value[-1] == pytest.approx(0.44, abs=2.5 * so_far.sd[-1])
    assert so_far.sd[-1] < 0.08
    for later in (6.4, 6.8, 7.2):  # on its way down, back on the table, let go
        told = object_frame.lifted_mass(moved.between(0.0, event.onset + later), made.geometry)
        assert told is not None and told.value[-1] == pytest.approx(0.44, abs=2.5 * told.sd[-1]), (
            later
        )
    whole = lift.measure(lift.Params(), moved, event.onset, event.end)
    curves = {c.name: c for c in lift.shown(whole).curves}
    last = curves["mass"].y[np.isfinite(curves["mass"].y)][-1]
    assert last == pytest.approx(whole.lifts[0].mass, rel=0.05)
    assert (curves["mass_high"].y - curves["mass_low"].y)[-2] == pytest.approx(
        2 * whole.lifts[0].mass_sd, rel=0.4
    )


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("third finger", "forces do not balance"),
        ("limit told", "force sensor at its limit"),
        ("limit not told", "force sensor at its limit"),
        ("step", "force sensor drifts"),
        ("lost", "force samples missing"),
        ("dead", "forces do not balance"),
        ("exchanged", "forces do not balance"),
    ],
)
def test_what_went_wrong_is_told_and_gives_no_mass(what: str, said: str) -> None:
    changes: dict[str, Change] = {
        "step": lambda t, v: np.where(
            (t > 4)[:, None, None] & (np.arange(2) == 0)[:, None], v + 0.8, v
        ),
        "lost": lambda t, v: np.where(((t > 3.5) & (t < 5))[:, None, None], np.nan, v),
        "dead": lambda t, v: np.where((np.arange(2) == 1)[:, None], v[:1], v),
        "exchanged": lambda t, v: v[:, ::-1],
    }
    if what in changes:
        good, followed_once = usual()
        made = changed(good, changes[what])
        bare, calibrations = without_forces(followed_once.trajectory), followed_once.calibrations
        moved, _ = fingertip_forces.attach_forces(
            ForceParams(), bare, list(made.blocks()), made.mounting, calibrations
        )
        found = measured(made, moved)
    else:
        limit = ForceErrors(limit=3.0) if what.startswith("limit") else None
        made, _ = done(
            0, mass=0.44, errors=limit, mishap=Mishap(third=0.33 if what == "third finger" else 0.0)
        )
        found = measured(changed(made, lambda t, v: v, told=what != "limit not told"))
    assert found.grade == "poor"
    assert said in found.reason
    assert [one for one in found.lifts if np.isfinite(one.mass)] == []
    f = {x.name: x for x in lift.figures(found)}
    untold = {name for name, x in f.items() if np.isnan(x.value)}
    assert {"lift_load_hold", "lift_grip_over_load", "lift_work"} <= untold
    assert (
        ("lift_grip_hold" in untold)
        == ("thumb_force_share" in untold)
        == (what in ("limit told", "limit not told", "lost"))
    )


def test_a_third_finger_that_carries_a_seventh_is_told_and_the_mass_is_as_unsure_as_it_is_wrong() -> (
    None
):
    made, _ = done(4, mass=0.44, mishap=Mishap(third=0.15))
    found = measured(made)
    assert found.grade == "fair"
    assert "another finger or something else may carry part of the load" in found.reason
    (one,) = found.lifts
    assert one.mass == pytest.approx(0.44, abs=2.5 * one.mass_sd)
    assert one.mass_sd / one.mass > 0.1


def test_a_slip_is_told_and_the_mass_stays() -> None:
    made, _ = done(1, mass=0.44, mishap=Mishap(slips=(3.0,)))
    found = measured(made)
    assert (found.grade, found.reason) == ("fair", "the object slipped")
    (one,) = found.lifts
    assert one.slips[0] == pytest.approx(made.events[-1].onset + 0.8 + 3.0, abs=0.2)
    assert one.mass == pytest.approx(0.44, abs=2.5 * one.mass_sd)


def test_lost_samples_here_and_there_cost_little() -> None:
    made, _ = done(2)
    lost = np.random.default_rng(0).random(len(made.samples["force"].t)) < 0.3
    (one,) = measured(changed(made, lambda t, v: np.where(lost[:, None, None], np.nan, v))).lifts
    assert one.mass == pytest.approx(0.28, rel=0.08)


def test_without_force_sensors_everything_is_as_it_was() -> None:
    made, _ = done(0)
    bare = replace(made, samples={"imu": made.samples["imu"]})
    moved = followed(bare).trajectory
    assert moved.forces is None
    np.testing.assert_array_equal(moved.angles, followed(made).trajectory.angles)
    assert {f.reason for f in lift.figures(measured(bare))} == {lift.NONE}
