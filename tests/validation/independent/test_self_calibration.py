"""Self-calibration judged from outside: the simulator shares nothing with it, its readings are of its own movement, errors are told as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import ACC, GYR
from handscope.sessions.formats import recordings as formats_recordings
from handscope.validation.independent import self_calibration
from handscope.validation.independent.self_calibration import CONDITIONS, HAND, WHAT, Found, Trial
from handscope.validation.independent.simulator import free_movement
from handscope.validation.independent.simulator.free_movement import (
    ACC_BIAS,
    DEG,
    GRAVITY,
    GYR_BIAS,
    LAWS,
    RIGHT_ANGLE,
    SHORT,
    Setup,
    written,
)
from handscope.validation.reproduce import Wanted


@pytest.mark.parametrize("law", LAWS)
def test_rates_and_accelerations_add_up_to_the_movement(law: str) -> None:
    """Of a sensor on skin: turns from its rates, and its place from what its accelerometer reads less gravity."""
    setup, segment, dt = Setup(3, "right", law=law), "index_middle", 1e-3
    body, movement = free_movement._body(setup), free_movement._movement(setup)
    t = np.arange(0.0, 0.6, dt)
    around = free_movement._around(setup, body, movement, t)
    R, p = free_movement._worn(setup, body, movement, segment, around[3])
    rate, force = free_movement._readings(setup, body, movement, segment, around, 1 / dt)
    means = free_movement._readings(
        replace(setup, means=True), body, movement, segment, around, 1 / dt
    )[0]
    np.testing.assert_allclose(means[1:], 0.5 * (rate[1:] + rate[:-1]), atol=1e-3)
    turned = Rotation.identity()
    for w in 0.5 * (rate[1:] + rate[:-1]):
        turned = turned * Rotation.from_rotvec(dt * w)
    assert (turned.inv() * Rotation.from_matrix(R[0].T @ R[-1])).magnitude() < 0.01 * DEG
    a = np.einsum("nij,nj->ni", R, force) - [0.0, 0.0, GRAVITY]
    later = free_movement._worn(setup, body, movement, segment, around[4])[1]
    begun = (later[:1] - p[:1]) / SHORT - 0.5 * SHORT * a[:1]
    speed = begun + dt * np.cumsum(
        np.concatenate([np.zeros((1, 3)), 0.5 * (a[1:] + a[:-1])]), axis=0
    )
    place = p[0] + dt * np.sum(0.5 * (speed[1:] + speed[:-1]), axis=0)
    np.testing.assert_allclose(place, p[-1], atol=1e-3)


def test_laws_of_skin_agree_on_what_a_right_angle_does_but_for_the_growing_one() -> None:
    def resting(t: np.ndarray) -> np.ndarray:
        return np.full(len(t), RIGHT_ANGLE)

    at_right_angle = {
        name: float(law(resting, np.zeros(1))[0]) / RIGHT_ANGLE for name, law in LAWS.items()
    }
    assert at_right_angle == pytest.approx(
        {
            "proportion": 1.0,
            "growing": 1.2,
            "levelling": 1 / RIGHT_ANGLE,
            "lagging": 1.0,
            "trailing": 1.0,
        }
    )


def test_a_recording_is_read_as_anybodys(tmp_path: Path) -> None:
    setup = Setup(
        1, "right", ("thumb", "index"), forearm=True, rate=50.0, duration=2.0, scatter=1e-3
    )
    true, read = (
        written(setup, tmp_path / "recording"),
        formats_recordings.load(tmp_path / "recording"),
    )
    assert (read.hand, set(read.samples), read.warnings) == ("right", {"imu", "forearm"}, ())
    hand = read.samples["imu"]
    assert hand.stream.sensors == (
        "hand",
        *free_movement.CHAINS["thumb"],
        *free_movement.CHAINS["index"],
    )
    assert 0.3e-3 < np.std(hand.t - np.arange(100) / 50.0) < 3e-3
    assert np.abs(hand.of(GYR)).max() > 5 * GYR_BIAS
    assert np.abs(np.linalg.norm(hand.of(ACC)[:, 0], axis=1) - GRAVITY).max() > ACC_BIAS
    assert read.geometry.palm_length == true.body.palm
    assert true.tips["index"].shape == (100, 3) and true.angles["wrist"].shape == (100, 3)
    still = written(
        Setup(1, "right", ("thumb", "index"), forearm=True, rate=100.0, duration=1.0),
        tmp_path / "other",
    )
    assert dict(still.body.lengths) == dict(true.body.lengths), "the same person at another rate"
    np.testing.assert_array_equal(still.tips["index"][:100:2], true.tips["index"][:50])


def test_errors_are_told_by_condition_and_refusals_in_words() -> None:
    trials = self_calibration.trials(Wanted(seeds=2))
    assert [t for t in trials if t.condition == HAND] == [Trial(HAND, 0)]
    good = Found("", dict.fromkeys(WHAT, 1e-3), dict.fromkeys(WHAT, 1.0), 0.5, 1.5, 9.0)
    refused = Found("index: it moved too little", {}, {}, 0.0, 0.0, 1.0)
    lagging = Found("", dict.fromkeys(WHAT, 4e-3), dict.fromkeys(WHAT, 16.0), 3.5, 8.0, 9.0)
    results = [
        (
            t,
            refused
            if t == Trial("slow (0.4 Hz)", 1)
            else lagging
            if t.condition == "skin that lags"
            else good,
        )
        for t in trials
    ]
    told = self_calibration.finding(Wanted(seeds=2), results)
    rows = {row.name: row for row in told.tables[0].rows}
    assert set(rows) == set(CONDITIONS)
    assert rows["100 Hz"].ours["lengths, mm"].mean == pytest.approx(1.0)
    assert rows["slow (0.4 Hz)"].ours["lengths, mm"].count == 1
    assert {v.what: v.met for v in told.verdicts} == {
        "skin as assumed: largest error of a length": True,
        "skin as assumed: the same in its standard deviation": True,
        "skin of another law than is assumed: largest error of a length": False,
        "skin of another law than is assumed: the same in its standard deviation": False,
    }
    only = self_calibration.trials(Wanted(seeds=1, experiments=("no skin",)))
    alone = self_calibration.finding(Wanted(seeds=1), [(trial, good) for trial in only])
    assert [row.name for row in alone.tables[0].rows] == ["no skin"] and len(alone.verdicts) == 2
    assert told.remarks == ("slow (0.4 Hz), person 1: refused (index: it moved too little).",)
