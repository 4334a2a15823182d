"""What every method of the table must do, whoever wrote it."""

import pickle
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data import trajectory
from handscope.estimators.data.options import describe
from handscope.estimators.data.samples import ACC, Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.method import Capabilities, Method
from handscope.estimators.simulation.scenario import Simulated
from tests.simulated import assert_same, calibrated, cut, in_strips, interleaved, with_samples

every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())


def _stepped(
    method: Method[Any, Any], recording: Simulated, pieces: list[Block], saved: bool = False
) -> Trajectory:
    params, found = method.Params(), calibrated(recording, method.Params())
    state, given = method.start(params, found, recording.streams), []
    for piece in pieces:
        state, moved = method.step(
            params,
            pickle.loads(pickle.dumps(state)) if saved else state,
            piece.between(found.t, np.inf),
        )
        given.append(moved)
    _, moved = method.finish(params, state)
    return trajectory.join([*given, moved], recording.hand)


@cache
def _ten_seconds() -> Simulated:
    """Pose, and thumb and index finger that bend."""
    whole = in_strips("left")
    return with_samples(whole, {n: b.between(-np.inf, 10.0) for n, b in whole.samples.items()})


@cache
def _left_whole(method: Method[Any, Any]) -> Trajectory:
    """What they give in one piece a strip, made once."""
    recording = _ten_seconds()
    return _stepped(method, recording, list(recording.blocks()))


def _pieces(recording: Simulated, where: list[int], seed: int = 1) -> list[Block]:
    return list(
        interleaved(
            {n: cut(b, where) for n, b in recording.samples.items()}, np.random.default_rng(seed)
        )
    )


@every_method
@given(where=st.lists(st.integers(0, 1000), max_size=10), seed=st.integers(0, 2**32 - 1))
def test_a_recording_may_be_cut_anywhere(
    method: Method[Any, Any], where: list[int], seed: int
) -> None:
    recording = _ten_seconds()
    pieces = _pieces(recording, where, seed)
    assert_same(_stepped(method, recording, pieces), _left_whole(method))


@every_method
@given(where=st.lists(st.integers(0, 1000), max_size=10))
def test_blocks_of_several_streams_may_come_together(
    method: Method[Any, Any], where: list[int]
) -> None:
    """As a live view gives them: what came of all strips since the last time in one step."""
    recording, params = _ten_seconds(), method.Params()
    found = calibrated(recording, params)
    batches = zip(*(cut(b, where) for b in recording.samples.values()), strict=True)
    state, given = method.start(params, found, recording.streams), []
    for batch in batches:
        blocks = [b.between(found.t, np.inf) for b in batch]
        state, moved = method.step(params, state, *blocks)
        given.append(moved)
    _, moved = method.finish(params, state)
    assert_same(trajectory.join([*given, moved], recording.hand), _left_whole(method))


@every_method
def test_a_strip_that_is_described_anew_loses_no_row_that_it_completes(
    method: Method[Any, Any],
) -> None:
    """In one step the last samples of a strip and the first ones under its new description."""
    recording, params = in_strips("left"), method.Params()
    found = calibrated(recording, params)
    blocks = [b.between(found.t, found.t + 4.0) for b in recording.samples.values()]
    changed = recording.samples["index"].between(found.t + 4.0, found.t + 5.0)
    stream = replace(changed.stream, sensors=changed.stream.sensors[:2])
    later = [Block(stream, changed.t, changed.values[:, :2])] + [
        b.between(found.t + 4.0, found.t + 5.0)
        for b in recording.samples.values()
        if b.stream.name != "index"
    ]
    start = method.start(params, found, recording.streams)
    _, together = method.step(params, start, *blocks, *later)
    state, alone = start, []
    for block in (*blocks, *later):
        state, moved = method.step(params, state, block)
        alone.append(moved)
    assert len(together) > 450
    assert_same(together, trajectory.join(alone, recording.hand))


@every_method
def test_a_method_goes_on_from_a_saved_state(method: Method[Any, Any]) -> None:
    recording = in_strips("right")
    pieces = _pieces(recording, [200, 500, 900])
    assert_same(
        _stepped(method, recording, pieces, saved=True), _stepped(method, recording, pieces)
    )


@every_method
@pytest.mark.parametrize("missing", ["thumb", "index", "little", "forearm"])
def test_a_method_survives_a_missing_strip(method: Method[Any, Any], missing: str) -> None:
    whole = in_strips("left")
    recording = with_samples(
        whole, {name: b for name, b in whole.samples.items() if name != missing}
    )
    moved = _stepped(method, recording, list(recording.blocks()))
    assert len(moved) > 1000
    assert np.isnan(moved.tips).all(axis=(0, 2)).sum() == (missing != "forearm")
    assert (np.diff(moved.t) > 0).all()


@every_method
def test_nothing_in_nothing_out(method: Method[Any, Any]) -> None:
    recording = in_strips("left")
    assert len(_stepped(method, recording, [b.between(1e9, 2e9) for b in recording.blocks()])) == 0


@every_method
def test_every_option_says_what_it_means_in_which_unit_and_where_it_comes_from(
    method: Method[Any, Any],
) -> None:
    for option in describe(method.Params):
        assert option.meaning, option.name
        assert option.source, option.name
        assert option.kind in ("float", "int", "bool", "str"), option.name
        assert option.unit or option.kind != "float", option.name
        assert not option.choices or option.default in option.choices, option.name
    assert method.Params() == method.Params()


@every_method
def test_a_method_has_a_title_and_says_what_it_can_do(method: Method[Any, Any]) -> None:
    assert isinstance(method.TITLE, str)
    assert len(method.TITLE) > 10
    assert isinstance(method.CAPABILITIES, Capabilities)
    assert method.__doc__
    for part in ("In ", "Out ", "Source ", "Limits "):
        assert f"\n{part}" in method.__doc__, part


@every_method
def test_a_mirrored_recording_gives_the_mirrored_hand(method: Method[Any, Any]) -> None:
    """In the mirror polar vectors change the sign of their components in the other hand's frames,
    axial ones (rates, magnetic fields) keep it."""
    recording = in_strips("left")
    mirrored = _in_the_mirror(recording)
    moved, seen = (_stepped(method, r, list(r.blocks())) for r in (recording, mirrored))
    np.testing.assert_array_equal(seen.t, moved.t)
    np.testing.assert_array_equal(seen.flags, moved.flags)
    np.testing.assert_allclose(seen.angles, moved.angles, atol=1e-9)
    np.testing.assert_allclose(seen.tips, -moved.tips, atol=1e-10)


def _in_the_mirror(recording: Simulated) -> Simulated:
    samples = {}
    for name, block in recording.samples.items():
        values = block.values.copy()
        if ACC in block.stream.quantities:
            values[..., block.stream.axes(ACC)] *= -1
        samples[name] = Block(block.stream, block.t, values)
    return replace(recording, hand="right", geometry=sized("right"), samples=samples)
