"""Simulated recordings for tests, made once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.pipeline import run
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from handscope.sessions.files.recording import LoadedRecording

DEG = np.pi / 180
INSTANT = m2.Params(gyr_reading="instant")  # as the simulated gyroscopes read
STRIPS = {
    "hand": ("hand",),
    **{finger: CHAINS[finger] for finger in FINGERS},
    "forearm": ("forearm",),
}


@cache
def pose_and_wiggle(hand: str, errors: SensorErrors = IDEAL) -> Simulated:
    """About 14 s: the initial pose, then one finger after the other bends; forearm at 60 Hz, everything else at 100 Hz."""
    return simulate(
        ["initial_pose", "wiggle"],
        hand,
        sized(hand),
        np.random.default_rng(5),
        errors,
        segments=SEGMENTS,
        rate=100.0,
        forearm_rate=60.0,
    )


@cache
def in_strips(hand: str) -> Simulated:
    """The same with a stream a strip, as a glove sends them."""
    return strips_of(pose_and_wiggle(hand))


def strips_of(whole: Simulated) -> Simulated:
    """The recording with a stream a strip."""
    samples = {}
    for block in whole.samples.values():
        for strip, sensors in STRIPS.items():
            columns = [block.stream.sensors.index(s) for s in sensors if s in block.stream.sensors]
            if columns:
                stream = replace(block.stream, name=strip, sensors=sensors)
                samples[strip] = Block(stream, block.t, block.values[:, columns])
    return replace(whole, samples=samples)


def calibrated(recording: Simulated, params: initial_pose.PoseParams | None = None) -> Calibration:
    """The calibration from the recording's first initial pose."""
    pose = initial_pose.pose_of(next(e for e in recording.events if e.trial_type == "initial_pose"))
    blocks = list(recording.samples.values())
    return initial_pose.calibrate(
        params or m2.Params(), recording.hand, recording.geometry, recording.mounting, blocks, pose
    )


def tracked(
    recording: Simulated, params: m2.Params | None = None, calibration: Calibration | None = None
) -> Trajectory:
    """What m2 makes of the recording."""
    params, calibration = params or INSTANT, calibration or calibrated(recording)
    return trajectory.join(list(run.run(m2, params, [calibration], recording)), recording.hand)


def with_samples(recording: Simulated, samples: Mapping[str, Block]) -> Simulated:
    return replace(recording, samples=dict(samples))


def loaded(recording: Simulated) -> LoadedRecording:
    """As if it came from a file."""
    return LoadedRecording(
        recording.hand, recording.geometry, recording.mounting, recording.samples, recording.events
    )


def cut(block: Block, where: Sequence[int]) -> list[Block]:
    """The block in pieces; positions beyond its end count modulo its length."""
    edges = [0, *sorted(k % (len(block.t) + 1) for k in where), len(block.t)]
    return [Block(block.stream, block.t[a:b], block.values[a:b]) for a, b in zip(edges, edges[1:])]


def interleaved(pieces: Mapping[str, list[Block]], rng: np.random.Generator) -> Iterator[Block]:
    """The pieces of several streams in a random order that keeps each stream's own."""
    waiting = {name: list(p) for name, p in pieces.items()}
    while waiting:
        name = str(rng.choice(sorted(waiting)))
        yield waiting[name].pop(0)
        if not waiting[name]:
            del waiting[name]


def assert_same(a: Trajectory, b: Trajectory) -> None:
    """Equal to the last bit."""
    for field in ("t", "angles", "q_GS", "tips", "flags"):
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field), err_msg=field)


@dataclass(frozen=True)
class Samples:
    """Blocks as `run` takes them."""

    streams: tuple[Stream, ...]
    pieces: tuple[Block, ...]

    def blocks(self) -> Iterator[Block]:
        yield from self.pieces
