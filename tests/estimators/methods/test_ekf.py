"""The method ekf from end to end: the truth recovered, honest standard deviations, whatever is
missing."""

import pickle
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.finger_ekf import output_covariance
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINT, JOINTS, SEGMENT, Hand
from handscope.estimators.hand.forward_kinematics import CHAIN_JOINTS
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.methods import ekf
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline import run
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import (
    PersonErrors,
    judged_samples,
    record_experiment,
)
from handscope.estimators.simulation.joint_compliance import AS_MEASURED
from handscope.estimators.simulation.movements import guided_movements, task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.estimators.interpreted import interpreted
from tests.simulated import (
    DEG,
    assert_same,
    calibrated,
    cut,
    in_strips,
    interleaved,
    pose_and_wiggle,
    strips_of,
    tracked,
    with_samples,
)

PARAMS = ekf.Params(
    gyr_reading="instant", pose_sd=1.45
)  # as the simulated gyroscopes read, and as these people take the pose


def _tracked(recording: Simulated, params: ekf.Params = PARAMS) -> Trajectory:
    return trajectory.join(
        list(run.run(ekf, params, [calibrated(recording, params)], recording)), recording.hand
    )


def _stepped(recording: Simulated, pieces: list[Block], saved: bool = False) -> Trajectory:
    found = calibrated(recording, PARAMS)
    state, given = ekf.start(PARAMS, found, recording.streams), []
    for piece in pieces:
        state, moved = ekf.step(
            PARAMS,
            pickle.loads(pickle.dumps(state)) if saved else state,
            piece.between(found.t, np.inf),
        )
        given.append(moved)
    _, moved = ekf.finish(PARAMS, state)
    return trajectory.join([*given, moved], recording.hand)


def _assert_all_same(a: Trajectory, b: Trajectory) -> None:
    assert_same(a, b)
    assert a.angles_sd is not None
    assert a.tips_sd is not None
    np.testing.assert_array_equal(a.angles_sd, b.angles_sd)
    np.testing.assert_array_equal(a.tips_sd, b.tips_sd)


def test_the_truth_is_recovered_without_noise(simulated: Simulated) -> None:
    moved = _tracked(simulated)
    np.testing.assert_array_equal(moved.t, simulated.truth.t)
    # accelerometers disagree while fingers turn
    assert np.nanmax(np.abs(moved.angles - simulated.truth.angles)) < 0.5 * DEG
    assert np.abs(moved.tips - simulated.truth.tips).max() < 1e-3
    assert not moved.flags.any()


def test_joints_begin_as_the_whole_pose_has_them_not_as_its_first_sample(
    simulated: Simulated, rng: np.random.Generator
) -> None:
    """Accelerometers with 0.1 m/s^2 of noise a sample, 0.6 deg of inclination."""
    noisy = {}
    for name, b in simulated.samples.items():
        noise = (
            0.1
            * rng.normal(size=b.values.shape)
            * (np.arange(b.values.shape[-1]) // 3 == list(b.stream.quantities).index(ACC))
        )
        noisy[name] = replace(b, values=b.values + noise)
    moved = _tracked(with_samples(simulated, noisy))
    assert np.abs(moved.angles[0] - simulated.truth.angles[0])[IS_DOF].max() < 0.2 * DEG


def test_every_angle_and_every_tip_has_a_standard_deviation(simulated: Simulated) -> None:
    moved = _tracked(simulated)
    assert moved.angles_sd is not None
    assert moved.tips_sd is not None
    np.testing.assert_array_equal(np.isfinite(moved.angles_sd).all(axis=0), IS_DOF)
    assert (moved.angles_sd[:, IS_DOF] > 0.5 * DEG).all()
    assert np.isfinite(moved.tips_sd).all()


def test_without_a_forearm_the_wrist_has_none_and_the_tips_do_not_count_it(
    simulated: Simulated,
) -> None:
    whole = in_strips("left")
    part = with_samples(whole, {name: b for name, b in whole.samples.items() if name != "forearm"})
    moved, expected = _tracked(part), _tracked(whole)
    assert moved.angles_sd is not None
    assert moved.tips_sd is not None
    assert expected.tips_sd is not None
    assert np.isnan(moved.angles_sd[:, JOINT["wrist"]]).all()
    whole_sd, part_sd = (np.linalg.norm(sd, axis=2) for sd in (expected.tips_sd, moved.tips_sd))
    assert (part_sd < whole_sd).all() and (part_sd[:, 2] < 0.97 * whole_sd[:, 2]).all()


EXPERIMENTS = ("AF-F1", "F-F3", "P4 F1-F2", "free")
NOISIER = replace(SensorErrors(), gyr_noise=0.04, acc_noise=1.2e-3)  # four times


def _somebody(
    name: str, seed: int, errors: SensorErrors, give: float = 0.0
) -> tuple[Simulated, Trajectory]:
    """A hand of its own, left or right, that misses the pose by up to 2.5 deg, sensors with all
    errors: what ekf makes of it."""
    hand: Hand = "left" if seed % 2 else "right"
    recording = record_experiment(
        experiments.EXPERIMENTS[name],
        np.random.default_rng(seed),
        errors,
        None,
        hand,
        person=PersonErrors(pose_deg=2.5, give_deg=give),
    )
    return recording, _tracked(recording)


@pytest.fixture(scope="module")
def performed() -> list[tuple[Simulated, Trajectory]]:
    return [_somebody(name, seed, SensorErrors()) for seed, name in enumerate(EXPERIMENTS)]


@pytest.fixture(scope="module")
def performed_noisily() -> list[tuple[Simulated, Trajectory]]:
    return [
        _somebody(name, seed, NOISIER, AS_MEASURED)
        for seed, name in enumerate(("AF-F2", "F-F2", "tapping", "free"), 4)
    ]


def _errors(performed: list[tuple[Simulated, Trajectory]], what: str) -> list[Array]:
    """Of angles or tips where the experiment is judged, estimate minus truth."""
    return [
        (getattr(moved, what) - getattr(recording.truth, what))[judged_samples(recording)]
        for recording, moved in performed
    ]


def test_it_is_never_worse_than_m2(performed: list[tuple[Simulated, Trajectory]]) -> None:
    """RMS of all angles and of all tips of each recording."""
    by_m2 = [(recording, tracked(recording)) for recording, _ in performed]
    for what, worse in (("angles", 1.05), ("tips", 1.12)):
        ours, theirs = (
            [np.sqrt(np.nanmean(e**2)) for e in _errors(p, what)] for p in (performed, by_m2)
        )
        assert (np.array(ours) < worse * np.array(theirs)).all(), what
        assert np.mean(ours) < 0.9 * np.mean(theirs), what


def _within_bounds(performed: list[tuple[Simulated, Trajectory]], what: str) -> Array:
    """Normalised error squared within its 95 % bounds: an angle of a recording is one draw, as what
    it errs by hardly changes; of the tips, which err together with the wrist, each axis is one. The
    normalised errors."""
    errors, normal = _errors(performed, what), []
    for (recording, moved), error in zip(performed, errors):
        sd = getattr(moved, f"{what}_sd")[judged_samples(recording)]
        z = (error / sd).reshape(len(error), -1)
        normal.append(z[:, np.isfinite(z).all(axis=0)])
    draws = sum(z.shape[1] if what == "angles" else 3 for z in normal)
    low, high = (float(chi2.ppf(p, draws)) / draws for p in (0.025, 0.975))
    assert low < np.mean(np.concatenate([(z**2).mean(axis=0) for z in normal])) < high
    return np.concatenate([z.ravel() for z in normal])


@pytest.mark.parametrize("what", ["angles", "tips"])
def test_standard_deviations_are_honest_with_all_errors(
    performed: list[tuple[Simulated, Trajectory]], what: str
) -> None:
    assert np.mean(np.abs(_within_bounds(performed, what)) < 2) > 0.93


@pytest.mark.parametrize("what", ["angles", "tips"])
def test_standard_deviations_are_honest_with_sensors_of_another_quality(
    performed_noisily: list[tuple[Simulated, Trajectory]], what: str
) -> None:
    """Noise of all sensors four times as large, which nobody has told the method; joints give as
    measured ones."""
    _within_bounds(performed_noisily, what)


def test_a_functional_calibration_tells_how_well_it_is_known_how_the_sensors_sit() -> None:
    """Sensors misaligned by 20-30 deg: the movements' calibration and its covariance are used, and
    the angles are as good as told. Accelerations at the thumb's base, which tell a part of the same, are left out."""
    errors = replace(SensorErrors(), misalignment=25.0, misalignment_width=5.0)
    recording = record_experiment(
        experiments.EXPERIMENTS["free"],
        np.random.default_rng(5103),
        errors,
        None,
        "left",
        person=PersonErrors(pose_deg=2.5),
        steps=True,
    )
    found: list[Array] = []
    for functional in (True, False):
        params = replace(PARAMS, functional=functional, joint_acceleration=False)
        moved = process(ekf, params, recording).trajectory
        assert moved.angles_sd is not None
        error = (moved.angles - recording.truth.angles)[judged_samples(recording)][:, IS_DOF]
        found += [
            np.sqrt((error**2).mean()) / DEG,
            np.abs(error / moved.angles_sd[judged_samples(recording)][:, IS_DOF]),
        ]
    assert found[0] < 1.5
    assert found[0] < 0.75 * found[2]
    assert (found[1] < 2).mean() > 0.95
    assert (
        found[3] < 2
    ).mean() > 0.9  # without it the pose has seen how far off the sensors are put on


def _derivative(f: Callable[[Array], Array], size: int, step: float = 1e-6) -> Array:
    return np.stack([(f(e) - f(-e)) / (2 * step) for e in step * np.eye(size)], axis=-1)


def test_what_self_calibration_found_before_counts_as_it_was_found() -> None:
    """Lengths change no angle, and tips are as sure as these are known; of sensors whose mounting was found to half a degree the joints are surer."""
    worn = pose_and_wiggle("left", replace(IDEAL, misalignment=4.0))
    mountings = dict(zip(worn.sensors.segments, worn.sensors.q_BS))
    lengths = {s: worn.geometry.lengths[s] for chain in CHAINS.values() for s in chain}
    everything = PriorCalibration(
        "left",
        mountings,
        {},
        lengths,
        dict.fromkeys(mountings, np.full(3, 0.5 * DEG)),
        dict.fromkeys(lengths, 1e-4),
    )
    plain, of_lengths, of_all = (
        process(ekf, PARAMS, worn, known=known).trajectory
        for known in (None, everything.of_hand(), everything)
    )
    np.testing.assert_array_equal(of_lengths.angles, plain.angles)
    assert plain.tips_sd is not None and of_lengths.tips_sd is not None
    assert np.nanmax(of_lengths.tips_sd - plain.tips_sd) < 0
    assert plain.angles_sd is not None and of_all.angles_sd is not None
    assert np.nanmedian(of_all.angles_sd / plain.angles_sd) < 0.9


def test_the_jacobian_of_the_tips_is_their_derivative(rng: np.random.Generator) -> None:
    """By the errors of their own joints and of the wrist; the bones lead to the tip."""
    geometry, q_pc = sized("right"), joint_angles.compose(rng.uniform(-0.6, 0.9, (len(JOINTS), 3)))
    for finger, joints in enumerate(CHAIN_JOINTS):

        def tip(d: Array, finger: int = finger, joints: Array = joints) -> Array:
            turned, columns = q_pc.copy(), [*joints, JOINT["wrist"]]
            turned[columns] = quat.multiply(q_pc[columns], quat.exp(d.reshape(4, 3)))
            return np.asarray(forward_kinematics.tips(turned, geometry)[finger])

        J, bones, places = (
            np.empty((3, 12)),
            np.empty((4, 3)),
            (geometry.roots()[finger], geometry.chain_offsets()[finger]),
        )
        interpreted(output_covariance.tip_row)(
            q_pc[JOINT["wrist"]], q_pc[joints], *places, J, bones
        )
        np.testing.assert_allclose(J, _derivative(tip, 12), atol=1e-8)
        np.testing.assert_allclose(bones.sum(axis=0), tip(np.zeros(12)), atol=1e-12)


@given(st.lists(st.integers(0, 1500), max_size=6), st.integers(0, 2**32 - 1))
def test_a_recording_with_gaps_may_be_cut_anywhere(where: list[int], seed: int) -> None:
    recording = _holed()
    pieces: Mapping[str, list[Block]] = {n: cut(b, where) for n, b in recording.samples.items()}
    in_turn = list(interleaved(pieces, np.random.default_rng(seed)))
    _assert_all_same(_stepped(recording, in_turn), _holed_whole())


def test_a_saved_state_goes_on_as_if_nothing_had_happened() -> None:
    recording = _holed()
    pieces = list(
        interleaved(
            {n: cut(b, [300, 700, 1000]) for n, b in recording.samples.items()},
            np.random.default_rng(1),
        )
    )
    _assert_all_same(_stepped(recording, pieces, saved=True), _stepped(recording, pieces))


@cache
def _holed_whole() -> Trajectory:
    """What it gives in one piece a strip, made once."""
    return _stepped(_holed(), list(_holed().samples.values()))


@cache
def _holed() -> Simulated:
    """One strip misses 0.1 s, one 0.4 s, of one a sensor is silent."""
    whole = in_strips("left")
    samples = dict(whole.samples)
    for name, first, count in (("index", 800, 10), ("ring", 900, 40)):
        block = samples[name]
        keep = np.ones(len(block.t), bool)
        keep[first : first + count] = False
        samples[name] = Block(block.stream, block.t[keep], block.values[keep])
    little = samples["little"]
    values = little.values.copy()
    values[500:520, 1] = np.nan
    samples["little"] = Block(little.stream, little.t, values)
    return with_samples(whole, samples)


def test_gaps_leave_no_nan_and_a_long_one_is_less_sure() -> None:
    moved = _holed_whole()
    assert moved.angles_sd is not None
    assert moved.tips_sd is not None
    assert np.isfinite(moved.tips).all()
    assert np.isfinite(moved.tips_sd).all()
    t = _holed().samples["hand"].t[[880, 935]]
    before, within = (moved.angles_sd[np.searchsorted(moved.t, x), JOINT["ring_mcp"], 0] for x in t)
    assert within > 20 * DEG > before


@pytest.mark.parametrize("missing", ["thumb", "index", "little", "forearm"])
def test_removing_a_strip_changes_no_bit_of_the_other_fingers(missing: str) -> None:
    whole = in_strips("left")
    part = with_samples(whole, {name: b for name, b in whole.samples.items() if name != missing})
    params = replace(PARAMS, pose_inference=False, shared_bias=False, shared_mounting=False)
    expected, moved = _tracked(whole, params), _tracked(part, params)
    own = [JOINT[j.name] for j in JOINTS if not {j.parent, j.child} & _segments(missing)]
    np.testing.assert_array_equal(moved.angles[:, own], expected.angles[:, own])
    assert moved.angles_sd is not None
    assert expected.angles_sd is not None
    np.testing.assert_array_equal(moved.angles_sd[:, own], expected.angles_sd[:, own])
    if missing != "forearm":
        assert np.isnan(moved.tips[:, FINGERS.index(missing)]).all()


def test_what_the_fingers_tell_thumb_and_wrist_comes_back_to_none_of_them() -> None:
    """Over movement of the whole hand; where it rests nothing is told."""
    whole = experiment_in_strips(SensorErrors(), "free")
    expected = _tracked(whole, replace(PARAMS, shared_bias=False, shared_mounting=False))
    moved = _tracked(whole)
    are_told = np.array(["thumb" in j.name or j.name == "wrist" for j in JOINTS])
    np.testing.assert_array_equal(moved.angles[:, ~are_told], expected.angles[:, ~are_told])
    for joint in ("thumb_cmc", "wrist"):
        assert (moved.angles[:, JOINT[joint]] != expected.angles[:, JOINT[joint]]).any()


@pytest.mark.slow  # test_joint_acceleration.py holds the rule for one joint
def test_accelerations_hold_the_thumb_where_gyroscopes_drift() -> None:
    """Two and a half minutes without a rest, biases that walk five times as fast as usual; the last half minute of four people."""

    def perform(geometry: HandGeometry, rng: np.random.Generator) -> tuple[Performance, ...]:
        return (
            task_performance.initial_pose(geometry),
            guided_movements.free(geometry, rng, duration=150.0),
        )

    moving = replace(experiments.EXPERIMENTS["free"], perform=perform)
    squares: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(8, 12):
        rng, errors = np.random.default_rng(seed), SensorErrors(gyr_bias_walk=0.005)
        whole = record_experiment(moving, rng, errors, None)
        for held, found in squares.items():
            moved = _tracked(whole, replace(PARAMS, bias_walk=0.005, joint_acceleration=held))
            late = moved.t > moved.t[-1] - 30.0
            error = (moved.angles - whole.truth.angles)[late, JOINT["thumb_cmc"]]
            found.append(float((error**2).mean()))
    assert np.sqrt(np.mean(squares[True])) < 0.7 * np.sqrt(np.mean(squares[False]))


@pytest.mark.parametrize("missing", ["index", "forearm"])
def test_a_strip_that_is_missing_in_the_pose_changes_the_others_by_less_than_their_sd(
    missing: str,
) -> None:
    """Gravity in all sensors together tells how the hand's sensor sits."""
    whole = experiment_in_strips(SensorErrors())
    part = with_samples(whole, {name: b for name, b in whole.samples.items() if name != missing})
    expected, moved = _tracked(whole), _tracked(part)
    own = [JOINT[j.name] for j in JOINTS if not {j.parent, j.child} & _segments(missing)]
    off = (moved.angles - expected.angles)[:, own]
    assert moved.angles_sd is not None
    assert np.nanmax(np.abs(off)) > 0.05 * DEG
    assert np.nanmax(np.abs(off) / moved.angles_sd[:, own]) < 1


def experiment_in_strips(errors: SensorErrors, name: str = "A-F2") -> Simulated:
    """Somebody moves one finger after another, or all; every sensor is misaligned and the pose is missed."""
    return strips_of(
        record_experiment(
            experiments.EXPERIMENTS[name],
            np.random.default_rng(8),
            errors,
            None,
            person=PersonErrors(pose_deg=2.5),
        )
    )


def _segments(strip: str) -> set[str]:
    return {s for s in SEGMENT if s == strip or s.startswith(f"{strip}_")}


def test_saturated_rates_are_bridged_and_said_to_be_unsure() -> None:
    recording = pose_and_wiggle("left")
    imu = recording.samples["imu"]
    stream = replace(imu.stream, full_scale={GYR: 10.0, ACC: 80.0})
    values = imu.values.copy()
    k, middle = int(np.searchsorted(imu.t, 8.45)), imu.stream.sensors.index("index_middle")
    values[k : k + 6, middle, 2] = 10.0
    moved = _tracked(
        with_samples(recording, {**recording.samples, "imu": Block(stream, imu.t, values)})
    )
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 1.0 * DEG
    assert (moved.flags[k : k + 6, SEGMENT["index_middle"]] & trajectory.Flag.SATURATED).all()


def test_a_forearm_and_strips_of_another_rate_are_taken_along() -> None:
    recording = in_strips("left")
    ring = recording.samples["ring"]
    slower = Block(replace(ring.stream, rate=50.0), ring.t[::2], ring.values[::2])
    moved = _tracked(
        with_samples(recording, {**recording.samples, "ring": slower}),
        replace(PARAMS, gyr_reading="instant"),
    )
    error = np.abs(moved.angles - recording.truth.angles)
    assert np.nanmax(error) < 1.5 * DEG
    assert np.isfinite(moved.tips).all()


def test_without_noise_the_method_gives_out_every_row_only_once() -> None:
    recording = simulate(
        ["initial_pose", "wiggle"],
        "right",
        sized("right"),
        np.random.default_rng(5),
        IDEAL,
        rate=50.0,
    )
    moved = _tracked(recording)
    assert (np.diff(moved.t) > 0).all()
    assert len(moved) == len(recording.truth.t)
