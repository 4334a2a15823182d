"""M1 where magnetometers are missing: what has no relation to the pose's heading turns nothing, and
flags do not depend on where blocks are cut."""

from dataclasses import replace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import b, m1
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.simulated import DEG

PARAMS = m1.Params(gyr_reading="instant")


def _recording(
    missing_until: float, tasks: tuple[str, ...] = ("initial_pose", "wiggle")
) -> Simulated:
    """Magnetometers of a stream of their own; the index finger's tip has none before an instant."""
    made = simulate(
        tasks, "left", sized("left"), np.random.default_rng(4), IDEAL, field=homogeneous()
    )
    mag = made.samples["mag"]
    values = mag.values.copy()
    values[mag.t < missing_until, mag.stream.sensors.index("index_distal")] = np.nan
    return replace(made, samples={**made.samples, "mag": Block(mag.stream, mag.t, values)})


def test_a_magnetometer_that_gave_nothing_in_the_pose_turns_nothing() -> None:
    recording = _recording(6.0)
    moved = process(m1, PARAMS, recording).trajectory
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 1.0 * DEG


def test_a_heading_that_no_magnetometer_has_given_yet_is_flagged_row_by_row() -> None:
    recording = _recording(6.0)
    whole, cut = (_stepped(recording, n) for n in (10**6, 70))
    np.testing.assert_array_equal(whole.flags, cut.flags)
    unknown = (cut.flags[:, SEGMENT["index_distal"]] & Flag.UNCALIBRATED) != 0
    np.testing.assert_array_equal(unknown, cut.t < 6.0 - 1e-9)


def test_a_field_that_is_not_the_one_learnt_is_flagged_while_it_lasts_and_only_there() -> None:
    made = simulate(
        ("initial_pose", "rom_fist", "rom_fist"),
        "left",
        sized("left"),
        np.random.default_rng(1),
        SensorErrors(),
        field=homogeneous(),
    )
    mag = made.samples["mag"]
    beside_iron = (mag.t > 30.0) & (mag.t < 36.0)
    values = mag.values + np.where(beside_iron[:, None, None], [30e-6, -20e-6, 10e-6], 0.0)
    moved = process(
        m1,
        m1.Params(),
        replace(made, samples={**made.samples, "mag": Block(mag.stream, mag.t, values)}),
    ).trajectory
    flagged = (moved.flags[:, SEGMENT["index_distal"]] & Flag.MAGNETIC) != 0
    assert flagged[(moved.t > 31.0) & (moved.t < 36.0)].all()
    assert not flagged[(moved.t < 30.0) | (moved.t > 38.0)].any()


def test_before_the_pose_magnetometers_count_too() -> None:
    recording = _recording(0.0, ("wiggle", "initial_pose"))
    samples = {
        **recording.samples,
        "mag": Block(*(lambda m: (m.stream, m.t, m.values * np.nan))(recording.samples["mag"])),
    }
    with_mag, without = (
        process(m1, PARAMS, r).trajectory for r in (recording, replace(recording, samples=samples))
    )
    before = with_mag.t < 5.0
    assert np.nanmax(np.abs(with_mag.q_GS[before] - without.q_GS[before])) > 1e-6
    assert np.nanmax(np.abs(with_mag.angles - recording.truth.angles)) < 1.0 * DEG


def _stepped(recording: Simulated, length: int) -> Trajectory:
    """B, whose headings come from magnetometers alone, over blocks of a length, in order of
    time."""
    sensors = [s for st in recording.streams if st.inertial for s in st.sensors]
    found = initial_pose.uncalibrated("left", recording.geometry, {}, sensors, 0.0)
    parts = sorted(
        (p for block in recording.blocks() for p in block.parts(length)), key=lambda p: p.t[-1]
    )
    state, given = b.start(b.Params(), found, recording.streams), []
    for part in parts:
        state, piece = b.step(b.Params(), state, part)
        given.append(piece)
    _, piece = b.finish(b.Params(), state)
    return trajectory.join([*given, piece], "left")
