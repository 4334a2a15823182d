"""Stretches in which a strip gave no samples: pulled, plugged in late, or the whole glove unplugged. Seen in its time stamps alone."""

from collections.abc import Mapping

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.sessions.files.recording import LoadedRecording

SHORTEST = 0.5  # s; what is shorter was lost on the way and is counted as that
SAMPLES = 3.0  # and at least as many sampling intervals


def absences(recording: LoadedRecording) -> Mapping[str, list[tuple[float, float]]]:
    """(from, to) in s by stream, only those that were absent; `from` is the last sample before, or the recording's first."""
    filled = [b.t for b in recording.samples.values() if len(b.t)]
    if not filled:
        return {}
    first, last = min(t[0] for t in filled), max(t[-1] for t in filled)
    found = {
        name: _gaps(block, float(first), float(last)) for name, block in recording.samples.items()
    }
    return {name: gaps for name, gaps in found.items() if gaps}


def _gaps(block: Block, first: float, last: float) -> list[tuple[float, float]]:
    t = np.concatenate(([first], block.t, [last]))
    gaps = np.flatnonzero(np.diff(t) > max(SHORTEST, SAMPLES / block.stream.rate))
    return [(float(t[k]), float(t[k + 1])) for k in gaps]
