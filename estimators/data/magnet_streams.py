"""Streams from which the hand's position is measured by its magnet: hand, trunk, magnetometers on the trunk."""

from collections.abc import Sequence

from handscope.estimators.data.samples import MAG, TRUNK, TRUNK_MAGNETOMETERS, Stream

HAND = "hand"


def is_relevant(stream: Stream) -> bool:
    """Whether a stream is used."""
    inertial = stream.inertial and bool({HAND, TRUNK} & set(stream.sensors))
    return inertial or (
        MAG in stream.quantities and any(p in (TRUNK, *TRUNK_MAGNETOMETERS) for p in stream.sensors)
    )


def find_magnetometers(streams: Sequence[Stream]) -> tuple[str, ...]:
    """Magnetometers on the trunk that are read, in the order of their numbers."""
    read = {p for s in streams if MAG in s.quantities for p in s.sensors}
    return tuple(p for p in (TRUNK, *TRUNK_MAGNETOMETERS) if p in read)
