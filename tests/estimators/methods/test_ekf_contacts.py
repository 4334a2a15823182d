"""Fingertips that are held together for calibration correct both fingers; those that were not together are refused."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from handscope.estimators.data import contact_constraint
from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.finger_ekf.filter import State
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT, JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.methods import ekf, ekf_contacts
from handscope.estimators.methods.ekf_contacts import Pending
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline import contacts
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import Experiment, PersonErrors, judged_samples
from handscope.estimators.simulation.movements import (
    task_performance,
    touched_fingertips,
    touched_surfaces,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import FULL_GLOVE, Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.accuracy import angle_difference
from tests.schedule import swept

PEOPLE = range(4)


Touch = Callable[[HandGeometry, np.random.Generator], Performance]
TOUCHES: Mapping[str, Touch] = {
    "table": touched_surfaces.fingertips_on_table,
    "palm": touched_surfaces.fingertips_on_palm,
    "one lifted": partial(touched_surfaces.fingertips_on_table, lifted={"ring": 0.03}),
    "two lifted": partial(
        touched_surfaces.fingertips_on_table, lifted={"ring": 0.05, "index": 0.03}
    ),
    "palm missed": partial(touched_surfaces.fingertips_on_palm, missed=0.05),
}


@cache
def recorded(
    seed: int, missed: float = 0.0, without: str = "nothing", touch: str = ""
) -> Simulated:
    """Pose, thumb on each fingertip (or `missed` m from it) or what `touch` names, tapping."""

    def perform(geometry: HandGeometry, rng: np.random.Generator) -> tuple[Performance, ...]:
        tips = partial(touched_fingertips.touch_fingertips, missed=missed)
        return (
            task_performance.initial_pose(geometry),
            TOUCHES.get(touch, tips)(geometry, rng),
            task_performance.tapping(geometry),
        )

    experiment = Experiment("touched", ("thumb", "index"), perform)
    return experiments.record_experiment(
        experiment,
        np.random.default_rng([seed, 19]),
        SensorErrors(),
        None,
        "left",
        person=PersonErrors(pose_deg=2.5, distribution="normal"),
        glove=replace(
            FULL_GLOVE,
            segments=tuple(s for s in FULL_GLOVE.segments if not s.startswith(without)),
        ),
    )


@cache
def processed(
    seed: int, missed: float = 0.0, contact_sd: float = 0.005, touch: str = ""
) -> Processed:
    params = replace(ekf.Params(), contact_sd=contact_sd)
    return process(ekf, params, recorded(seed, missed, touch=touch))


def errors(moved: Trajectory, recording: Simulated) -> tuple[Array, Array]:
    """Of thumb and index in the judged samples: angles, rad, and normalised."""
    joints = [JOINT[j.name] for j in JOINTS if j.name.startswith(("thumb", "index"))]
    where = np.flatnonzero(judged_samples(recording))
    rows = np.searchsorted(moved.t, recording.truth.t[where] - 1e-6)
    free = IS_DOF[joints]
    off = angle_difference(moved.angles[rows][:, joints], recording.truth.angles[where][:, joints])
    assert moved.angles_sd is not None
    return off[:, free], (off / moved.angles_sd[rows][:, joints])[:, free]


def told_codes(found: Processed) -> list[str]:
    """Codes of what is said of contacts, without those of their names."""
    names = {"contacts.pair", "contacts.palm", "contacts.table"}
    every = (codes_of(w) - names for w in found.warnings)
    return [c for codes in every for c in codes if c.startswith("contacts.")]


@pytest.mark.parametrize("people", swept([2, 4], kept=[2]))
def test_angles_err_less_with_contacts_and_as_much_as_standard_deviations_say(people: int) -> None:
    """People whose pose misses every freedom by 2.5 deg."""
    squares = {
        sd: [
            np.nanmean(errors(processed(seed, 0.0, sd).trajectory, recorded(seed))[0] ** 2)
            for seed in PEOPLE[:people]
        ]
        for sd in (0.0, 0.005)
    }
    assert np.mean(squares[0.005]) < np.mean(squares[0.0])
    normalised = [errors(processed(s).trajectory, recorded(s))[1] for s in PEOPLE[:people]]
    assert 0.3 < np.mean([np.nanmean(n**2) for n in normalised]) < 2.5


@pytest.mark.parametrize("people", swept([2, 4], kept=[2]))
@pytest.mark.parametrize("touch", swept(["table", "palm"], kept=["palm"]))
def test_a_table_and_the_palm_correct_angles_too(touch: str, people: int) -> None:
    """The same movement with and without what the contacts tell: six of the thumb's and the index finger's joints."""
    squares = {
        sd: np.mean(
            [
                np.nanmean(
                    errors(
                        processed(s, contact_sd=sd, touch=touch).trajectory,
                        recorded(s, touch=touch),
                    )[0]
                    ** 2
                )
                for s in PEOPLE[:people]
            ]
        )
        for sd in (0.0, 0.005)
    }
    assert squares[0.005] < squares[0.0]
    assert {*told_codes(processed(0, touch=touch))} == {"contacts.used"}


def test_a_finger_that_is_lifted_is_left_out_and_named() -> None:
    for seed in PEOPLE[:2]:
        found = processed(seed, touch="one lifted")
        assert {*told_codes(found)} == {"contacts.used", "contacts.left_out"}
        (told,) = [w for w in found.warnings if "contacts.left_out" in codes_of(w)]
        assert "not touching: ring finger" in told


@pytest.mark.parametrize(("touch", "count"), [("two lifted", 1), ("palm missed", 5)])
def test_fingertips_that_touch_nothing_pull_nothing(touch: str, count: int) -> None:
    found = processed(1, touch=touch)
    assert told_codes(found) == count * ["contacts.refused"]
    without = processed(1, contact_sd=0.0, touch=touch).trajectory
    np.testing.assert_array_equal(found.trajectory.angles, without.angles)


def test_a_contact_in_which_a_finger_moves_is_not_used_and_told() -> None:
    """The event of the first contact begins so early that the thumb is still on its way."""
    recording = recorded(0)
    first = next(e for e in recording.events if e.trial_type == "contact")
    late = replace(first, onset=first.onset - 2.2, duration=first.duration + 2.2)
    moved = replace(
        recording,
        events=tuple(late if e is first else e for e in recording.events),
    )
    assert sorted(told_codes(process(ekf, ekf.Params(), moved))) == [
        "contacts.moving",
        "contacts.used",
    ]


@pytest.mark.parametrize("touch", ["", "table", "palm"])
def test_a_contacts_derivatives_are_those_of_differences(touch: str) -> None:
    """By every error of the chains that take part."""
    recording = recorded(2, touch=touch)
    (calibration,) = contacts.with_contacts(calibrate(ekf.Params(), recording)[0], recording.events)
    state = ekf.start(ekf.Params(), calibration, recording.streams)
    held = calibration.contacts[0]
    for block in recording.blocks():
        state, _ = ekf.step(ekf.Params(), state, block.between(calibration.t, held.onset + 0.5))

    def measured(chains: State) -> ekf_contacts._Innovation:
        hand = ekf_contacts.HandState(chains, calibration.geometry, state.of_lengths)
        touches = [
            ekf_contacts._touch(hand, place, held) for place in contact_constraint.places_of(held)
        ]
        return ekf_contacts._innovation(ekf.Params(), hand, Pending(held), touches)

    found = measured(state.chains)
    step = 1e-5
    for f, H in found.by_joints.items():
        for k in (*range(9), *range(ERROR.q_SB, ERROR.soft_tissue)):
            q_pc, q_SB = state.chains.q_pc.copy(), state.chains.q_SB.copy()
            d = step * np.eye(SIZE)[k]
            q_pc[f] = ekf_contacts._turned(q_pc[f], d[: ERROR.bias])
            q_SB[f] = ekf_contacts._turned(q_SB[f], d[ERROR.q_SB : ERROR.soft_tissue])
            after = measured(replace(state.chains, q_pc=q_pc, q_SB=q_SB)).constraint.residual
            change = (after - found.constraint.residual) / step
            np.testing.assert_allclose(H[:, k], change, atol=2e-3, err_msg=f"{FINGERS[f]} {k}")


def test_a_contact_that_did_not_happen_pulls_nothing_and_is_told() -> None:
    """The thumb stays 5 cm from each fingertip, and the events say that it touched."""
    for seed in PEOPLE[:2]:
        found = processed(seed, 0.05)
        assert told_codes(found) == 4 * ["contacts.refused"]
        without = processed(seed, 0.05, 0.0).trajectory
        np.testing.assert_array_equal(found.trajectory.angles, without.angles)
        np.testing.assert_array_equal(found.trajectory.tips, without.tips)


def test_a_contact_that_is_likelier_without_touch_pulls_nothing() -> None:
    """3 cm are no rare error of this person's pose, each with a chance of one in 350 to 900; but a thumb that does not touch is easily so far away."""
    found = processed(6, 0.03)
    assert told_codes(found) == 4 * ["contacts.refused"]
    without = processed(6, 0.03, contact_sd=0.0).trajectory
    np.testing.assert_array_equal(found.trajectory.angles, without.angles)


def test_which_contacts_were_used_is_told() -> None:
    (told,) = [w for w in processed(0).warnings if "contacts.used" in codes_of(w)]
    assert "thumb on index finger" in told
    assert "thumb on little finger" in told


def test_what_a_contact_tells_does_not_depend_on_where_blocks_end() -> None:
    recording, found = recorded(1), []
    (calibration,) = contacts.with_contacts(calibrate(ekf.Params(), recording)[0], recording.events)
    for size in (29, 2048):
        state, pieces = ekf.start(ekf.Params(), calibration, recording.streams), []
        for block in recording.blocks():
            for part in block.between(calibration.t, 22.0).parts(size):
                state, piece = ekf.step(ekf.Params(), state, part)
                pieces.append(piece.tips)
        found.append(np.concatenate(pieces))
    np.testing.assert_array_equal(found[0], found[1])


def test_a_contact_of_a_finger_that_is_not_measured_is_told_and_the_others_are_used() -> None:
    recording = recorded(2)
    little = Event(8.0, 1.6, "contact", {"contacts": "thumb_bottom-nose_bottom"})
    assert held_contacts([little]) == ()
    held = held_contacts(recording.events)
    assert [h.contacts[0].part for h in held] == [
        f"thumb_{f}" for f in ("index", "middle", "ring", "little")
    ]
    found = process(ekf, ekf.Params(), recorded(2, without="little"))
    assert sorted(told_codes(found)) == ["contacts.not_measured", "contacts.used"]


def test_a_contact_belongs_to_the_pose_before_it() -> None:
    """Held before the first pose's end it belongs to none."""
    (calibration,) = calibrate(ekf.Params(), recorded(0))[0]
    early = Event(calibration.t, 0.5, "contact", {"contacts": "thumb_bottom-index_bottom"})
    late = Event(60.0, 2.0, "contact", {"contacts": "thumb_bottom-index_bottom"})
    again = replace(calibration, t=50.0, end=53.0)
    first, second = contacts.with_contacts([calibration, again], [early, late])
    assert (len(first.contacts), len(second.contacts)) == (0, 1)


def test_the_derivative_of_a_point_is_that_of_differences(rng: np.random.Generator) -> None:
    q, root, offsets = quat.normalize(rng.normal(size=(3, 4))), rng.normal(size=3), np.eye(3)
    bones, J = ekf_contacts._point(q, root, offsets)
    step = 1e-6
    for k, d in enumerate(step * np.eye(9)):
        moved = quat.multiply(q, quat.exp(d.reshape(3, 3)))
        difference = ekf_contacts._point(moved, root, offsets)[0].sum(axis=0) - bones.sum(axis=0)
        np.testing.assert_allclose(J[:, k], difference / step, atol=1e-5)
