"""Corrections of what sensors read, as a recording's events: samples stay raw in the file and are corrected whenever it is read.

In      events of `CORRECTION` with one of
            exchange A B [C D ...]     the readings of A are those of B and the other way round
            gyroscope A[,B...] M       nine numbers, row by row: the matrix that turns readings into rates
        under `correction`
Out     blocks and recordings that are corrected from their beginning; the events are marked `applied`, so that an export is not corrected again
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handscope.estimators.data.samples import GYR, Block, Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array
from handscope.sessions.files.recording import LoadedRecording

CORRECTION = "correction"  # type of event, and its column


@dataclass(frozen=True)
class SensorCorrection:
    """One correction: of names, or of rates."""

    text: str
    names: Mapping[str, str]  # name that holds, by name that was written
    rates: Mapping[str, Array]  # (3, 3) by sensor

    @property
    def kind(self) -> str:
        return self.text.split()[0]

    @property
    def sensors(self) -> tuple[str, ...]:
        return (*self.names, *self.rates)


def from_finding(
    sensors: Sequence[str], correction: Mapping[str, object] | None
) -> SensorCorrection | None:
    """The correction that a finding of the checks leaves as the only answer; None where it is not one of these."""
    known: Mapping[str, Any] = correction or {}
    if "exchange" in known:
        pairs = np.array(known["exchange"]).reshape(-1, 2)
        return parse("exchange " + " ".join(pairs.ravel()))
    if "gyr" in known:
        numbers = (f"{x:.6g}" for x in np.asarray(known["gyr"], float).ravel())
        return parse(f"gyroscope {','.join(sensors)} {' '.join(numbers)}")
    return None


def parse(text: str) -> SensorCorrection:
    """A correction as it is written; InputError for anything else."""
    kind, *words = text.split() or [""]
    if kind == "exchange" and len(words) >= 2 and len(words) % 2 == 0:
        pairs = list(zip(words[::2], words[1::2]))
        names = dict([*pairs, *(pair[::-1] for pair in pairs)])
        if len(names) == len(words) and names.keys() <= SEGMENT.keys():
            return SensorCorrection(text, names, {})
    if kind == "gyroscope" and len(words) == 10 and {*words[0].split(",")} <= SEGMENT.keys():
        try:
            M = np.array([float(x) for x in words[1:]]).reshape(3, 3)
        except ValueError:
            M = np.full((3, 3), np.nan)
        if np.isfinite(M).all():
            return SensorCorrection(text, {}, dict.fromkeys(words[0].split(","), M))
    raise InputError("recording.unknown_correction", text=text)


def correct_block(block: Block, corrections: Sequence[SensorCorrection]) -> Block:
    """A block with names and rates corrected, in the order of the corrections."""
    for one in corrections:
        stream = block.stream
        if one.names.keys() & {*stream.sensors}:
            sensors = tuple(one.names.get(s, s) for s in stream.sensors)
            block = replace(block, stream=replace(stream, sensors=sensors))
        if GYR in stream.quantities and one.rates.keys() & {*stream.sensors}:
            values, axes = block.values.copy(), stream.axes(GYR)
            for k, name in enumerate(stream.sensors):
                if name in one.rates:
                    values[:, k, axes] = values[:, k, axes] @ one.rates[name].T
            block = replace(block, values=values)
    return block


def correct_recording(recording: LoadedRecording) -> LoadedRecording:
    """A recording with the corrections applied that its events ask for, each with a warning that says so."""
    due = [e for e in recording.events if e.trial_type == CORRECTION and not _is_applied(e)]
    if not due:
        return recording
    corrections = [parse(str(e.details.get(CORRECTION, ""))) for e in due]
    return replace(
        recording,
        samples={name: correct_block(b, corrections) for name, b in recording.samples.items()},
        events=tuple(_mark_applied(e) if e in due else e for e in recording.events),
        warnings=(*recording.warnings, *(_sentence(c) for c in corrections)),
    )


def _is_applied(event: Event) -> bool:
    return str(event.details.get("applied", "")).lower() in ("yes", "true")


def _mark_applied(event: Event) -> Event:
    return replace(event, details={**event.details, "applied": "yes"})


def _sentence(correction: SensorCorrection) -> str:
    names = ", ".join(correction.sensors)
    if correction.names:
        return phrase("correction.exchanged", names=names)
    return phrase("correction.rates", names=names)
