"""Run a method over a whole recording: once for every method, the same steps as live.

From one calibration to the next the method starts at the pose and steps through the blocks behind
it. What lies before the first pose is gone through backwards from the pose's end (so that the
filters settle while the hand is still): time runs the other way, so angular rates and gyroscope
biases change their sign.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import GYR, Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import FusionParams
from handscope.estimators.pipeline.method import Method

P = TypeVar("P")
S = TypeVar("S")
PIECE = 2048  # samples at a time: what a step makes of them stays in the processor's cache


class Samples(Protocol):
    """The part of a recording that a method needs; `blocks` may be called more than once."""

    @property
    def streams(self) -> tuple[Stream, ...]: ...

    def blocks(self) -> Iterator[Block]: ...


def run(
    method: Method[P, S],
    params: P,
    calibrations: Sequence[Calibration],
    samples: Samples,
    on_end: Callable[[S], None] = lambda state: None,
) -> Iterator[Trajectory]:
    """Pieces of the trajectory in order of time; every calibration (in order of time) serves until
    the next one. `on_end` is given the state in which each but what lies before the first ends."""
    first = calibrations[0]
    before = [
        b.between(-np.inf, first.end) for b in samples.blocks() if len(b.t) and b.t[0] < first.end
    ]
    if any(b.t[0] < first.t for b in before if b.stream.inertial):
        for piece in _backwards(method, params, first, samples.streams, before):
            yield piece.between(-np.inf, first.t)
    ends = [c.t for c in calibrations[1:]] + [np.inf]
    for calibration, end in zip(calibrations, ends):
        yield from _forwards(
            method,
            params,
            calibration,
            samples.streams,
            (b.between(calibration.t, end) for b in samples.blocks()),
            on_end,
        )


def _forwards(
    method: Method[P, S],
    params: P,
    calibration: Calibration,
    streams: tuple[Stream, ...],
    blocks: Iterable[Block],
    on_end: Callable[[S], None] = lambda state: None,
) -> Iterator[Trajectory]:
    state = method.start(params, calibration, streams)
    for block in blocks:
        for part in block.parts(PIECE):
            state, piece = method.step(params, state, part)
            yield piece
    state, piece = method.finish(params, state)
    on_end(state)
    yield piece


def _backwards(
    method: Method[P, S],
    params: P,
    calibration: Calibration,
    streams: tuple[Stream, ...],
    blocks: list[Block],
) -> Iterator[Trajectory]:
    biases = {name: -bias for name, bias in calibration.gyr_bias.items()}
    turned = replace(calibration, gyr_bias=biases, t=-calibration.t, end=-calibration.t)
    means = isinstance(params, FusionParams) and params.gyr_reading == "mean"
    pieces = list(_forwards(method, params, turned, streams, _reversed(blocks, means)))
    while pieces:
        piece = pieces.pop()
        yield replace(piece.reversed(), t=-piece.t[::-1])


def _reversed(blocks: Sequence[Block], means: bool) -> Iterator[Block]:
    """Time runs the other way; where rates are `means` since the sample before, the turn back to a
    sample is that of the following one."""
    streams: dict[tuple[object, ...], Stream] = {}
    for stream in (b.stream for b in blocks):
        streams.setdefault(_identity(stream), stream)
    following: dict[tuple[object, ...], Array] = {}  # rates of the sample behind a block
    for block in (b for b in reversed(blocks) if len(b.t)):
        key, values = _identity(block.stream), block.values[::-1].copy()
        if GYR in block.stream.quantities:
            gyr = block.stream.axes(GYR)
            first = values[-1, :, gyr].copy()
            if means:
                values[1:, :, gyr] = values[:-1, :, gyr].copy()
                values[0, :, gyr] = following.get(key, values[0, :, gyr])
            following[key] = first
            values[..., gyr] *= -1
        yield Block(streams[key], -block.t[::-1], values)


def _identity(stream: Stream) -> tuple[object, ...]:
    """What blocks of one stream have in common, also where the stream is described anew."""
    return stream.name, stream.sensors, stream.rate
