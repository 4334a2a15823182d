"""Magnetometers of hand and tips in ekf: an option that helps where headings are lost, and that
nothing needs."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import MAG, Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.finger_ekf import filter as finger_ekf_filter
from handscope.estimators.finger_ekf import magnetic_heading, preintegration
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import IS_DOF, JOINT, SEGMENT
from handscope.estimators.methods import ekf
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline import run
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import (
    PersonErrors,
    judged_samples,
    record_experiment,
)
from handscope.estimators.simulation.magnetic_field import homogeneous, office
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from tests.estimators.interpreted import interpreted
from tests.schedule import swept
from tests.simulated import DEG, assert_same, calibrated, cut, in_strips, with_samples

WITHOUT = ekf.Params(gyr_reading="instant")
WITH = replace(WITHOUT, magnetometers=True)
NUMBERS = finger_ekf_filter.pack_params(WITH)


def _tracked(recording: Simulated, params: ekf.Params) -> Trajectory:
    return trajectory.join(
        list(run.run(ekf, params, [calibrated(recording, params)], recording)), recording.hand
    )


def _look(q_pc: Array, mag: Array, up: Array, sd: float = 1.0) -> tuple[bool, float, Array]:
    innovation, H, noise = np.zeros(1), np.zeros((1, SIZE)), np.zeros((1, 1))
    used = interpreted(magnetic_heading.heading_row)(
        NUMBERS, q_pc, mag, up, np.zeros(2), sd**2 * np.eye(SIZE), innovation, H, noise
    )
    return used, innovation[0], H[0]


def _posed(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """A chain's rotations (3, 4), the same field (2, 3) and the vertical (4, 3) in the frames of
    its first and last sensor."""
    q_pc = joint_angles.compose(rng.uniform(-0.3, 0.9, (3, 3)))
    q_HT = quat.multiply(quat.multiply(q_pc[0], q_pc[1]), q_pc[2])
    field, up = 50.0 * np.array([0.3, -0.2, -0.93]), np.array([0.1, 0.2, 0.97])
    mag = np.stack([field, quat.rotate(quat.conjugate(q_HT), field)])
    return q_pc, mag, np.tile(up / np.linalg.norm(up), (4, 1))


def test_the_heading_s_jacobian_is_its_derivative(rng: np.random.Generator) -> None:
    """Where the two fields differ in everything."""
    q_pc, mag, up = _posed(rng)
    mag = mag + rng.normal(size=(2, 3))

    def missed(dth: Array) -> float:
        return _look(quat.multiply(q_pc, quat.exp(dth.reshape(3, 3))), mag, up)[1]

    numeric = np.array([(missed(e) - missed(-e)) / 2e-6 for e in 1e-6 * np.eye(9)])
    np.testing.assert_allclose(_look(q_pc, mag, up)[2][:9], -numeric, atol=1e-7)


def test_one_field_misses_nothing_and_a_turn_about_the_vertical_is_its_angle(
    rng: np.random.Generator,
) -> None:
    q_pc, mag, up = _posed(rng)
    assert _look(q_pc, mag, up)[1] == pytest.approx(0.0, abs=1e-12)
    turned = q_pc.copy()
    turned[0] = quat.multiply(quat.exp(0.3 * up[0]), q_pc[0])
    assert _look(turned, mag, up)[1] == pytest.approx(-0.3, abs=1e-12)


def test_fields_of_another_size_or_dip_and_unlikely_headings_are_left_out(
    rng: np.random.Generator,
) -> None:
    q_pc, mag, up = _posed(rng)
    assert _look(q_pc, mag, up)[0]
    assert not _look(q_pc, mag * [[1.0], [1.2]], up)[0]
    # about what is level and across the field
    tilted = quat.exp(-0.4 * np.cross(up[0], mag[0]) / np.linalg.norm(np.cross(up[0], mag[0])))
    q_HT = quat.multiply(quat.multiply(q_pc[0], q_pc[1]), q_pc[2])
    dipped = quat.rotate(quat.conjugate(q_HT), quat.rotate(tilted, mag[0]))
    assert not _look(q_pc, np.stack([mag[0], dipped]), up)[0]
    far = q_pc.copy()
    far[0] = quat.multiply(quat.exp(1.0 * up[0]), q_pc[0])
    assert _look(far, mag, up)[0]
    assert not _look(far, mag, up, sd=0.02)[0]


def _without_thumb(recording: Simulated, seconds: float) -> tuple[Simulated, Array]:
    """The thumb's strip silent, beginning a second after the task does; which samples are judged
    behind that."""
    from_here = recording.truth.t[judged_samples(recording)][0] + 1.0
    samples = dict(recording.samples)
    for name, block in samples.items():
        silent = np.ix_(
            (block.t >= from_here) & (block.t < from_here + seconds),
            [s.startswith("thumb") for s in block.stream.sensors],
        )
        values = block.values.copy()
        values[silent] = np.nan
        samples[name] = Block(block.stream, block.t, values)
    return with_samples(recording, samples), judged_samples(recording) & (
        recording.truth.t > from_here + seconds + 1.0
    )


@pytest.mark.parametrize("people", swept([1, 2], kept=[1]))
def test_a_heading_lost_by_a_gap_is_recovered_with_honest_deviations(people: int) -> None:
    """People whose thumb is silent for a second in a homogeneous field: the CMC joint, of which
    nothing else tells the heading."""
    errors: dict[bool, list[float]] = {False: [], True: []}
    normal = []
    for seed in range(7001, 7001 + people):
        whole = record_experiment(
            experiments.EXPERIMENTS["AF-F1"],
            np.random.default_rng(seed),
            SensorErrors(),
            homogeneous(0.3),
            "left",
            person=PersonErrors(pose_deg=2.5),
        )
        recording, behind = _without_thumb(whole, 1.0)
        for params in (WITHOUT, WITH):
            moved = _tracked(recording, params)
            assert moved.angles_sd is not None
            error = (moved.angles - recording.truth.angles)[behind]
            errors[params.magnetometers].append(
                float(np.sqrt((error[:, JOINT["thumb_cmc"]] ** 2).mean()))
            )
            normal.append((error / moved.angles_sd[behind])[:, IS_DOF] ** 2)
    assert min(errors[False]) > 8 * DEG
    assert max(errors[True]) < 3 * DEG
    # with them it is never surer than it may be
    assert 0.3 < np.mean(np.concatenate(normal[1::2])) < 1.25


@pytest.mark.parametrize("seeds", swept([(7000,), (7000, 7002)], kept=[(7000,)]))
def test_in_a_disturbed_room_the_gates_keep_it_harmless(seeds: tuple[int, ...]) -> None:
    """A steel desk that turns headings by tens of degrees from hand to tip."""
    for seed in seeds:
        field = office(np.random.default_rng(seed - 6950), 0.3)
        recording = record_experiment(
            experiments.EXPERIMENTS["AF-F1"],
            np.random.default_rng(seed),
            SensorErrors(),
            field,
            "left",
            person=PersonErrors(pose_deg=2.5),
        )
        rms = [
            float(
                np.sqrt(
                    np.nanmean(
                        (_tracked(recording, p).angles - recording.truth.angles)[
                            judged_samples(recording)
                        ]
                        ** 2
                    )
                )
            )
            for p in (WITHOUT, WITH)
        ]
        assert rms[1] < 1.1 * rms[0]


def test_magnetometers_that_are_not_there_or_not_wanted_change_no_bit() -> None:
    recording = in_strips("left")
    assert_same(_tracked(recording, WITH), _tracked(recording, WITHOUT))
    magnetic = _magnetic(recording)
    assert_same(_tracked(magnetic, WITHOUT), _tracked(recording, WITHOUT))
    assert (
        np.abs(_tracked(magnetic, WITH).angles - _tracked(recording, WITHOUT).angles)[
            :, IS_DOF
        ].max()
        > 0
    )


def test_with_magnetometers_a_recording_may_be_cut_anywhere() -> None:
    recording, given = _magnetic(in_strips("left")), []
    for where in ([], [400, 401, 777, 1003]):
        state, moved = ekf.start(WITH, calibrated(recording, WITH), recording.streams), []
        pieces = [
            piece
            for block in recording.samples.values()
            for piece in cut(block, where)
            if len(piece.t)
        ]
        for piece in sorted(pieces, key=lambda p: float(p.t[0])):
            state, part = ekf.step(WITH, state, piece.between(state.calibration.t, np.inf))
            moved.append(part)
        moved.append(ekf.finish(WITH, state)[1])
        given.append(trajectory.join(moved, recording.hand))
    assert_same(*given)


def _magnetic(recording: Simulated) -> Simulated:
    """The same with the magnetometers of a hand in a homogeneous field, made from the truth."""
    t, q_GS, streams = (
        recording.truth.t[::2],
        recording.truth.q_GS[::2],
        [b.stream for b in recording.samples.values()],
    )
    sensors = tuple(s for stream in streams for s in stream.sensors)
    return with_samples(
        recording, {**recording.samples, "mag": _fields(recording, sensors, t, q_GS)}
    )


def _fields(recording: Simulated, sensors: tuple[str, ...], t: Array, q_GS: Array) -> Block:
    fields = quat.rotate(
        quat.conjugate(q_GS[:, [SEGMENT[s] for s in sensors]]), homogeneous().earth
    )
    return Block(Stream("mag", sensors, (MAG,), 50.0), t, fields)


def test_what_fields_differ_by_is_forgotten_over_a_turn() -> None:
    still, turned = (
        np.tile(quat.IDENTITY, (4, 1)),
        np.tile(quat.exp(np.array([0.0, 2.0, 0.0])), (4, 1)),
    )
    P = np.zeros((SIZE, SIZE))
    P[ERROR.field_difference, ERROR.field_difference] = 0.25
    for T, expected in (
        (still, 0.25),
        (turned, np.exp(-4) * 0.25 + 2 * WITH.mag_error**2 * (1 - np.exp(-4))),
    ):
        q_pc, after = np.tile(quat.IDENTITY, (3, 1)), np.empty(P.shape)
        interpreted(preintegration.propagate_row)(
            NUMBERS, 0.0, T, np.zeros((4, 3, 3)), np.zeros(4), q_pc, P, q_pc.copy(), after
        )
        assert after[ERROR.field_difference, ERROR.field_difference] == pytest.approx(expected)
