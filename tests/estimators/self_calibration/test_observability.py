"""The live meter is honest: it grows with movement, stays empty for what does not move, and promises nothing that self-calibration does not find."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import observability as meter
from handscope.estimators.self_calibration.observability import AccumulatedInformation, Limb
from handscope.estimators.self_calibration.problem import Noise
from handscope.estimators.self_calibration.result import Requirements
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.self_calibration.fingers import looked, recorded, stiffened, watched

ASKED = Requirements()
JOINTS = ("index_mcp", "index_pip", "index_dip")
BENT = dict.fromkeys(JOINTS, np.radians(np.linspace(0.0, 40.0, 500)))


def lengths_sd(of: Limb, told: AccumulatedInformation) -> Array:
    """Of proximal and middle phalanx, m."""
    _, proximal, middle = (o.length_sd for o in meter.assess_joints(ASKED, of, told, BENT))
    return np.array([proximal, middle])


def test_information_of_stretches_adds_up_and_never_falls() -> None:
    made = recorded(2, 16.0, skin=True)
    of, stretches = looked(made, 3.0, 9.0, noise=Noise())
    on_skin, of = of, replace(of, hand_skin=0.0)  # it is a rigid board
    sds = [lengths_sd(of, meter.no_information(of))]
    so_far = meter.no_information(of)
    for told in stretches:
        so_far = meter.add_information(so_far, told)
        sds.append(lengths_sd(of, so_far))
    assert (sds[0] > 8e-3).all()  # what given lengths are good for
    assert (np.diff(sds, axis=0) < 1e-5).all()
    assert (sds[-1] < 1e-3).all()
    assert lengths_sd(on_skin, so_far)[0] > 1.3 * sds[-1][0], (
        "skin of a hand that slides with the joint looks like length"
    )
    (_, (whole,)) = looked(made, 3.0, 9.0, every=6.0, noise=Noise())
    np.testing.assert_allclose(lengths_sd(of, so_far), lengths_sd(of, whole), rtol=0.15)


def test_a_hand_at_rest_tells_nothing_whatever_its_noise() -> None:
    of, stretches = looked(recorded(2, 16.0, skin=True), 0.0, 1.9)
    resting = meter.add_information(*stretches)
    assert (lengths_sd(of, resting) > 0.95 * lengths_sd(of, meter.no_information(of))).all()
    assert max(o.share for o in meter.assess_joints(ASKED, of, resting, BENT)) < 0.2


def test_a_stiff_finger_on_a_turning_hand_tells_no_length() -> None:
    made = stiffened(4, 11.0, dict.fromkeys((f"{joint}_flexion" for joint in JOINTS), 20.0))
    assert max(o.share for o in watched(made)) < 0.1
    of, stretches = looked(made, 0.0, 11.0)
    so_far = stretches[0]
    for told in stretches[1:]:
        so_far = meter.add_information(so_far, told)
    assert max(o.share for o in meter.assess_joints(ASKED, of, so_far, BENT)) < 1.0, (
        "though its joints were bent"
    )


def test_enough_is_said_only_of_a_joint_that_was_bent_long_enough_by_a_hand_that_moved() -> None:
    made = recorded(2, 16.0, skin=True)
    of, stretches = looked(made, 3.0, 14.0)
    so_far = stretches[0]
    for told in stretches[1:]:
        so_far = meter.add_information(so_far, told)
    shares = [o.share for o in meter.assess_joints(ASKED, of, so_far, BENT)]
    assert shares == [1.0, 1.0, 1.0]
    half = meter.assess_joints(
        ASKED, of, so_far, {**BENT, "index_pip": np.append(np.radians([5.0, 15.0]), np.nan)}
    )
    assert [round(o.share, 1) for o in half] == [1.0, 0.5, 1.0]
    for less in (
        replace(so_far, seconds=5.0),
        replace(so_far, turned=np.radians(0.5 * ASKED.moving * so_far.seconds)),
    ):
        assert max(o.share for o in meter.assess_joints(ASKED, of, less, BENT)) == pytest.approx(
            0.5, abs=0.01
        )


def test_samples_that_are_missing_tell_nothing_and_spoil_nothing() -> None:
    made = recorded(2, 16.0, skin=True)
    of, (whole,) = looked(made, 5.0, 7.0, every=2.0)
    _, (bridged,) = looked(_without(made, 540, 544), 5.0, 7.0, every=2.0)
    assert (lengths_sd(of, bridged) > 0.99 * lengths_sd(of, whole)).all()
    np.testing.assert_allclose(lengths_sd(of, bridged), lengths_sd(of, whole), rtol=0.2)


def _without(made: Simulated, start: int, stop: int) -> Simulated:
    block = made.samples["imu"]
    values = block.values.copy()
    values[start:stop, 2] = np.nan
    return replace(made, samples={"imu": replace(block, values=values)})


def test_a_finger_with_one_sensor_is_looked_at_as_far_as_that_tells() -> None:
    made = recorded(2, 16.0, skin=True)
    block = made.samples["imu"]
    stream = replace(block.stream, sensors=block.stream.sensors[:2])
    (mcp,) = watched(
        replace(made, samples={"imu": replace(block, stream=stream, values=block.values[:, :2])})
    )
    assert mcp.joint == "index_mcp"
    assert 10e-3 < mcp.length_sd < 0.1, (
        "where along its axis a printed hinge lies is told by no movement"
    )
    assert 0.0 < mcp.share < 1.0
