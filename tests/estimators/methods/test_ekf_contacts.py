"""Fingertips that are held together for calibration correct both fingers; those that were not together are refused."""

from dataclasses import replace
from functools import cache

import numpy as np

from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import IS_DOF, JOINT, JOINTS
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.methods import ekf, ekf_contacts
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline import contacts
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import Experiment, PersonErrors, judged_samples
from handscope.estimators.simulation.movements import task_performance, touched_fingertips
from handscope.estimators.simulation.scenario import FULL_GLOVE, Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.accuracy import angle_difference

PEOPLE = range(4)


@cache
def recorded(seed: int, missed: float = 0.0, without: str = "nothing") -> Simulated:
    """Pose, thumb on each fingertip (or `missed` m from it), tapping."""
    experiment = Experiment(
        "touched",
        ("thumb", "index"),
        lambda geometry, rng: (
            task_performance.initial_pose(geometry),
            touched_fingertips.touch_fingertips(geometry, rng, missed=missed),
            task_performance.tapping(geometry),
        ),
    )
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
def processed(seed: int, missed: float = 0.0, contact_sd: float = 0.005) -> Processed:
    return process(ekf, replace(ekf.Params(), contact_sd=contact_sd), recorded(seed, missed))


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
    """Codes of what is said of contacts."""
    return [c for w in found.warnings for c in codes_of(w) if c.startswith("contacts.")]


def test_angles_err_less_with_contacts_and_as_much_as_standard_deviations_say() -> None:
    """Four people whose pose misses every freedom by 2.5 deg."""
    squares = {
        sd: [
            np.nanmean(errors(processed(seed, 0.0, sd).trajectory, recorded(seed))[0] ** 2)
            for seed in PEOPLE
        ]
        for sd in (0.0, 0.005)
    }
    assert np.mean(squares[0.005]) < np.mean(squares[0.0])
    normalised = [errors(processed(s).trajectory, recorded(s))[1] for s in PEOPLE]
    assert 0.3 < np.mean([np.nanmean(n**2) for n in normalised]) < 2.5


def test_a_contact_that_did_not_happen_pulls_nothing_and_is_told() -> None:
    """The thumb stays 5 cm from each fingertip, and the events say that it touched."""
    for seed in PEOPLE[:2]:
        found = processed(seed, 0.05)
        assert told_codes(found) == 4 * ["contacts.refused"]
        without = processed(seed, 0.05, 0.0).trajectory
        np.testing.assert_array_equal(found.trajectory.angles, without.angles)
        np.testing.assert_array_equal(found.trajectory.tips, without.tips)


def test_which_contacts_were_used_is_told() -> None:
    (told,) = [w for w in processed(0).warnings if "contacts.used" in codes_of(w)]
    assert "thumb-index" in told
    assert "thumb-little" in told


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
    assert [h.contact.part for h in held] == [
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
