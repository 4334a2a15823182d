"""Full scales that a recording does not state, from readings that repeat their largest value; with
them clipped samples are bridged, not used.

In      samples of a stream, one block; or a whole Recording
Out     the value at which each sensor clips, or the same recording with the full scales that were
        found
Source  smallest and usual full scales: data sheets of MPU-9250 and LSM330DLC; the rule is ours
Limits  a sensor whose readings were corrected for misalignment clips at no single value, and
        sensors of one stream may clip at different values: without known full scales neither is
        bridged by tracking, the second is reported by fault_detection.py and bridged by self-calibration
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import (
    ACC,
    GYR,
    Block,
    Recording,
    RecordingView,
    Stream,
)
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

USUAL = {
    GYR: np.radians([245.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0]),
    ACC: GRAVITY * np.array([2.0, 4.0, 8.0, 16.0]),
}
LEAST = {GYR: np.radians(240.0), ACC: 1.9 * GRAVITY}
NEAR = 0.02  # of a usual full scale: what a scale error leaves
# of the largest reading, by which a parabola through the readings beside equal ones exceeds them at least where they are cut off; what less takes away is no more than a scale error
ROUND_TOP = 0.005
OFTEN = 3  # equal largest readings: in a row anywhere, separate ones only near a usual full scale
# rad/s: a gyroscope clips below LEAST, too, where so many rows of equal largest readings say so
SLOW, PLATEAUS = (
    np.radians(60.0),
    3,
)


def find_limits(block: Block, quantity: str) -> Array:
    """Where each sensor clips (sensors,): its known full scale, a value that its readings repeat,
    or inf."""
    if quantity in block.stream.full_scale:
        return np.full(len(block.stream.sensors), block.stream.full_scale[quantity])
    values = block.of(quantity)
    furthest = np.maximum(
        np.fmax.reduce(values, axis=0, initial=0.0), -np.fmin.reduce(values, axis=0, initial=0.0)
    )
    least = SLOW if quantity == GYR else LEAST[quantity]
    if (furthest < least).all():
        return np.full(len(furthest), np.inf)
    size = np.abs(values)
    largest = np.max(size, axis=0, initial=0.0, where=np.isfinite(size))
    top = size == largest
    in_a_row = top[2:] & top[1:-1] & top[:-2]
    begins = np.diff(in_a_row, axis=0, prepend=False) & in_a_row
    plateaus = np.zeros(largest.shape, int)
    for row, sensor, axis in np.argwhere(begins):
        is_cut = _is_cut_off(size[:, sensor, axis], top[:, sensor, axis], int(row))
        plateaus[sensor, axis] += is_cut
    usual = (np.abs(largest[..., None] / USUAL[quantity] - 1.0) < NEAR).any(axis=-1)
    clips = (largest >= LEAST[quantity]) & ((plateaus > 0) | (usual & (top.sum(axis=0) >= OFTEN)))
    clips |= (largest >= least) & (plateaus >= PLATEAUS)
    return np.asarray(np.where(clips, largest, np.inf).min(axis=1))


def _is_cut_off(size: Array, top: NDArray[np.bool_], first: int) -> bool:
    """Whether what surrounds the equal readings (n,) from `first` on would have them rise further: coarse readings repeat the top of a peak that was not cut off."""
    last = first + int(np.argmin(np.append(top[first:], False))) - 1
    beside = np.array([first - 2, first - 1, last + 1, last + 2])
    if beside[0] < 0 or beside[-1] >= len(size) or not np.isfinite(size[beside]).all():
        return True
    middle = 0.5 * (first + last)
    peak = np.polyfit((beside - middle) / (last - first + 3), size[beside], 2)[-1]
    return bool(peak > (1 + ROUND_TOP) * size[first])


def find_full_scales(blocks: Iterable[Block]) -> dict[str, dict[str, float]]:
    """Full scales by stream and quantity inferred where not declared: where one of its sensors clips
    and none reads more."""
    seen: dict[str, dict[str, float]] = {}
    for block in (b for b in blocks if b.stream.inertial):
        for quantity in (q for q in (GYR, ACC) if q not in block.stream.full_scale):
            limit, values = find_limits(block, quantity).min(initial=np.inf), block.of(quantity)
            if (
                np.isfinite(limit)
                and np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
                <= (1 + NEAR) * limit
            ):
                seen.setdefault(block.stream.name, {})[quantity] = float(limit)
    return seen


def declare_full_scales(samples: Mapping[str, Block]) -> dict[str, Block]:
    """The same samples by stream, their streams telling the full scales that were found."""
    scales = find_full_scales(samples.values())
    return {n: replace(b, stream=_declare(b.stream, scales)) for n, b in samples.items()}


def _declare(stream: Stream, scales: Mapping[str, Mapping[str, float]]) -> Stream:
    return replace(stream, full_scale={**stream.full_scale, **scales.get(stream.name, {})})


@dataclass(frozen=True)
class WithFullScales(RecordingView):
    """A recording whose streams tell the full scales that were found."""

    scales: Mapping[str, Mapping[str, float]]  # by stream and quantity

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(_declare(s, self.scales) for s in self.recording.streams)

    def blocks(self) -> Iterator[Block]:
        return (self.scaled(b) for b in self.recording.blocks())

    def scaled(self, block: Block) -> Block:
        """The same samples of a stream that states its full scales."""
        return replace(block, stream=_declare(block.stream, self.scales))


def with_full_scales(recording: Recording, blocks: Iterable[Block]) -> Recording:
    """The recording of these blocks with the full scales that are found in it, where there are any."""
    scales = find_full_scales(blocks)
    return WithFullScales(recording, scales) if scales else recording
