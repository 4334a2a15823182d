"""Recordings of devices that fuse themselves: our own fusion's orientations, each sensor with a heading of its own."""

from dataclasses import replace
from functools import cache

import numpy as np

from handscope.estimators.data.samples import ORIENTATION, Block
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.orientation import fusion
from handscope.estimators.simulation.scenario import Simulated
from tests.simulated import INSTANT, calibrated, in_strips, with_samples


@cache
def oriented_strips(hand: str) -> Simulated:
    return fused(in_strips(hand))


def fused(recording: Simulated, headings: float = 1.0, seed: int = 3) -> Simulated:
    """The recording as our own fusion's orientations alone, each sensor with a heading of its own
    (`headings` 0: all as they were)."""
    known, rng = calibrated(recording), np.random.default_rng(seed)
    samples = {}
    for name, block in recording.samples.items():
        state = fusion.start(block.stream, {}, known.gyr_bias)
        state, part = fusion.step(INSTANT, state, block)
        _, rest = fusion.finish(INSTANT, state)
        q = np.concatenate([part.q_GS, rest.q_GS])
        turns = headings * rng.uniform(-np.pi, np.pi, q.shape[1])
        stream = replace(block.stream, quantities=(ORIENTATION,))
        samples[name] = Block(stream, block.t, quat.turn_heading(q, turns))
    return with_samples(recording, samples)
