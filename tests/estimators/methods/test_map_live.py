"""The experiment `map-live`: it keeps the contract of methods that step, and says when it does not know."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators import methods
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import CHAINS, JOINT, SEGMENT
from handscope.estimators.methods import map_live
from handscope.estimators.simulation.scenario import Simulated
from tests.simulated import DEG, assert_same, calibrated, cut, in_strips, with_samples

WORN = ("hand", "index", "forearm")
BEGIN, END = 3.0, 6.0  # s: the index finger bends
PARAMS = map_live.Params(gyr_reading="instant", window=0.5)


@cache
def recording() -> Simulated:
    """A hand with a strip on the index finger and one on the forearm, of another rate."""
    whole = in_strips("left")
    return with_samples(whole, {name: whole.samples[name].between(0.0, END) for name in WORN})


@cache
def posed() -> Calibration:
    return replace(calibrated(recording()), t=BEGIN, end=BEGIN)


def stepped(made: Simulated, pieces: list[Block], saved: bool = False) -> Trajectory:
    state, given = map_live.start(PARAMS, posed(), made.streams), []
    for piece in pieces:
        state, moved = map_live.step(
            PARAMS,
            pickle.loads(pickle.dumps(state)) if saved else state,
            piece.between(BEGIN, np.inf),
        )
        given.append(moved)
    _, moved = map_live.finish(PARAMS, state)
    return trajectory.join([*given, moved], made.hand)


def pieces(made: Simulated, where: list[int]) -> list[Block]:
    """Strip after strip in turn, cut at these samples."""
    parts = [cut(b, where) for b in made.samples.values()]
    return [piece for turn in zip(*parts) for piece in turn]


@cache
def whole() -> Trajectory:
    return stepped(recording(), list(recording().blocks()))


def test_it_is_an_experiment_that_no_page_offers() -> None:
    assert map_live.TITLE.startswith("experiment, not for patients")
    assert methods.EXPERIMENTS["map-live"] is methods.ALL_METHODS["map-live"] is map_live
    assert "map-live" not in methods.OFFERED
    assert "map-live" not in methods.METHODS


def test_a_recording_may_be_cut_anywhere_and_gone_on_with_from_a_saved_state() -> None:
    assert_same(stepped(recording(), pieces(recording(), [333, 341, 480]), saved=True), whole())


def test_a_finger_that_bends_is_followed() -> None:
    moved, true = whole(), recording().truth
    rows = np.searchsorted(true.t, moved.t - 1e-6)
    assert len(moved) == round((END - BEGIN) * 100)
    for joint in ("index_mcp", "index_pip", "index_dip"):
        off = moved.angles[:, JOINT[joint], 0] - true.angles[rows, JOINT[joint], 0]
        assert np.sqrt(np.mean(off**2)) < 2 * DEG, joint


def test_what_is_not_measured_is_not_told() -> None:
    moved = whole()
    assert np.isnan(moved.angles[:, JOINT["ring_pip"]]).all()
    assert moved.angles_sd is not None
    assert np.isnan(moved.angles_sd[:, JOINT["ring_pip"]]).all()
    assert (moved.angles_sd[:, JOINT["index_pip"], 0] < 10 * DEG).all()


@pytest.mark.parametrize("silent", [0.1, 0.6])
def test_a_gap_leaves_numbers_with_flags(silent: float) -> None:
    """A strip that is silent for a while: bridged, or its heading is lost and that is said; what is told errs as it says."""
    made = recording()
    block = made.samples["index"]
    gap = (block.t > 4.0) & (block.t < 4.0 + silent)
    holed = with_samples(
        made, {**made.samples, "index": Block(block.stream, block.t[~gap], block.values[~gap])}
    )
    moved = stepped(holed, list(holed.blocks()))
    own = [SEGMENT[s] for s in CHAINS["index"]]
    inside = (moved.t > 4.01) & (moved.t < 3.99 + silent)
    assert len(moved) == len(whole())
    assert (moved.flags[inside][:, own] & Flag.MISSING).all()
    assert (moved.flags[inside][:, own] & Flag.HEADING_LOST).any() == (silent > PARAMS.max_gap)
    assert np.sqrt(np.mean(_in_deviations(moved) ** 2)) < 2


def test_samples_that_fit_no_hand_widen_what_is_told_or_leave_it_to_the_filter() -> None:
    """One accelerometer as if it were thrown about."""
    made, rng = recording(), np.random.default_rng(3)
    block = made.samples["index"]
    values = block.values.copy()
    values[400:, 1, 3:6] += rng.normal(0, 50, (len(values) - 400, 3))
    shaken = with_samples(made, {**made.samples, "index": Block(block.stream, block.t, values)})
    assert np.sqrt(np.mean(_in_deviations(stepped(shaken, list(shaken.blocks()))) ** 2)) < 2


def test_an_hour_of_silence_costs_nothing() -> None:
    made = recording()
    later = {
        n: Block(b.stream, np.where(b.t < 4.5, b.t, b.t + 3600.0), b.values)
        for n, b in made.samples.items()
    }
    moved = stepped(
        made,
        [
            b
            for block in later.values()
            for b in (block.between(0, 4.5), block.between(4.5, np.inf))
        ],
    )
    assert len(moved) == len(whole())
    assert np.isfinite(moved.angles[:, JOINT["index_pip"], 0]).all()
    assert (moved.flags[moved.t > 3600.0][:, SEGMENT["index_middle"]] & Flag.HEADING_LOST).any()


def _in_deviations(moved: Trajectory) -> np.ndarray:
    """Errors of the index finger's flexions (n, 3) in their standard deviations."""
    joints = [JOINT[j] for j in ("index_mcp", "index_pip", "index_dip")]
    true = recording().truth
    assert moved.angles_sd is not None
    off = (
        moved.angles[:, joints, 0]
        - true.angles[np.searchsorted(true.t, moved.t - 1e-6)][:, joints, 0]
    )
    return np.asarray(off / moved.angles_sd[:, joints, 0])


def test_without_the_hands_sensor_nothing_is_known_of_fingers() -> None:
    made = with_samples(recording(), {n: recording().samples[n] for n in ("index", "forearm")})
    moved = stepped(made, list(made.blocks()))
    assert np.isnan(moved.angles[:, JOINT["index_mcp"]]).all()
