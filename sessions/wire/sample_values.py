"""The values of sample bursts: bytes of a Samples message as its stream's description reads them, and back."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from handscope.estimators.data.samples import COMPONENTS, width_of
from handscope.sessions.wire.messages import Format, Samples, StreamInfo

MISSING_COUNT = -32768


def has_expected_size(samples: Samples, info: StreamInfo, sensors: int) -> bool:
    """Whether a burst has the bytes that its stream's description says."""
    return len(samples.data) == samples.count * sensors * width_of(info.quantities) * (
        2 if info.format is Format.INT16 else 4
    )


def decode_values(bursts: Sequence[Samples], info: StreamInfo, sensors: int) -> Any:
    """Sample values (samples, sensors, width) of bursts that fit, in SI units, float64; NaN counts as missing."""
    kind = np.dtype("<i2" if info.format is Format.INT16 else "<f4")
    data = b"".join(samples.data for samples in bursts)
    with np.errstate(invalid="ignore"):  # a signalling NaN is a missing sample like any other
        raw = (
            np.frombuffer(data, kind).reshape(-1, sensors, width_of(info.quantities)).astype(float)
        )
    if info.format is Format.INT16:
        raw[raw == MISSING_COUNT] = np.nan
        raw *= _by_component(info)
    return raw


def encode_values(values: Any, info: StreamInfo) -> bytes:
    """The inverse of `values_of`: SI values (count, sensors, axes) to the bytes of a Samples message, clipped to what the format holds."""
    if info.format is Format.FLOAT32:
        return np.asarray(values).astype("<f4").tobytes()
    counts = np.rint(np.asarray(values) / _by_component(info))
    return (
        np.where(np.isnan(counts), MISSING_COUNT, np.clip(counts, -32767, 32767))
        .astype("<i2")
        .tobytes()
    )


def _by_component(info: StreamInfo) -> Any:
    """The scale of each component (width,) of a sample."""
    return np.repeat(info.scale, [len(COMPONENTS[q]) for q in info.quantities])
