"""What gravity in the initial pose shows of a hand that was not flat, from a recording on."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import CHAINS, FINGERS, FLEXION, JOINT
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.methods import ekf, m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.recording_checks.check import check_processed, suspicions_of
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator.free_movement import BEGUN, DEG, Setup
from handscope.validation.reproduce.accuracy import angle_difference
from tests.simulated import pose_and_wiggle

CONTRACTED = {"ring_pip": 35 * DEG, "little_pip": 40 * DEG}


def test_fingers_that_cannot_be_straightened_are_asked_about_and_taken_as_bent() -> None:
    person = Setup(100, fingers=FINGERS, duration=14.0, missed=3 * DEG)
    recording, true = write_and_load(replace(person, bent=CONTRACTED))
    off = {}
    for method in (m2, ekf):
        made = check_processed(process(method, method.Params(), recording), recording)
        (said,) = (s for s in made.suspicions if s.message.code == "person.bent_in_pose")
        assert {"ring_middle", "little_middle"} <= {*said.sensors}
        assert "person.bent_in_pose" in {c for w in made.warnings for c in codes_of(w)}
        assert {s.message.severity for s in made.suspicions} == {
            "info"
        }  # no joint beyond its limits
        moved = made.trajectory
        rows = np.clip(np.searchsorted(true.t, moved.t - 1e-6), 0, len(true.t) - 1)
        after = moved.t > BEGUN
        for joint in CONTRACTED:
            found = angle_difference(moved.angles[:, JOINT[joint]], true.angles[joint][rows])
            off[method, joint] = np.mean(found[after, FLEXION])
    assert all(abs(off[m2, joint]) > 25 * DEG for joint in CONTRACTED)
    assert all(abs(off[ekf, joint]) < 15 * DEG for joint in CONTRACTED)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_thumb_that_is_turned_as_the_other_hands_is_told(hand: str) -> None:
    right = pose_and_wiggle(hand, SensorErrors())
    assert not {"hand.other_thumb"} & {s.message.code for s in suspicions_of(right)}
    (pose, *others) = right.events
    mirrored = {
        column: -pose.details[column]
        for column in ("thumb_cmc_deviation_deg", "thumb_cmc_pronation_deg")
    }
    other = replace(right, events=(replace(pose, details={**pose.details, **mirrored}), *others))
    (found,) = (s for s in suspicions_of(other) if s.message.code == "hand.other_thumb")
    assert set(CHAINS["thumb"]) | {"hand"} <= set(found.sensors)
    assert found.message.severity == "warning"
