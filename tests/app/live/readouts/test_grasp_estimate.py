"""What the hand holds while the task is still on: told with its standard deviation, and how the fingertips push."""

from functools import partial

import numpy as np

from handscope.app.live.readouts.grasp_estimate import GraspEstimator
from handscope.app.live.tracking import Tracking
from handscope.estimators.alignment import initial_pose
from handscope.estimators.methods import m2
from tests.app.devices.virtual import wait_for
from tests.app.live.test_tracking import play
from tests.estimators.force.lifted import done
from tests.simulated import INSTANT


def test_while_it_is_held_its_mass_is_told_and_each_fingertip_s_force_is_where_it_is() -> None:
    made, true = done(3, mass=0.44)
    pose, task = made.events
    now = task.onset + 4.5  # off the table from 0.8 s on, for five seconds
    tracking = Tracking(m2, INSTANT, "left", made.geometry, lambda rows: None)
    with tracking:
        play(
            tracking,
            {name: block.between(0.0, now) for name, block in made.samples.items()},
            initial_pose.pose_of(pose),
        )
        held = GraspEstimator(tracking)
        assert held.fingertip_forces("lift") is None  # nothing is known of the task yet
        held.update("lift", task.onset)
        wait_for(partial(held.number_of, "lift"))
        told, forces = held.number_of("lift"), held.fingertip_forces("lift")
        assert held.fingertip_forces("squeeze") is None
        assert held.fingertip_forces(None) is None
    assert told is not None and abs(told["value"] - 0.44) < 3 * told["sd"] < 0.2
    assert forces is not None
    expected = true[np.searchsorted(made.truth.t, now)]
    assert (
        np.linalg.norm(forces[:2] - expected[:2], axis=1).max()
        < 0.15 * np.linalg.norm(expected[:2], axis=1).min()
    )
    assert np.isnan(forces[2:]).all()
