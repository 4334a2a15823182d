"""What a recording lacks, in words for the terminal: stretches without a strip, losses on the way, an early end."""

from collections.abc import Iterator

from handscope.sessions.files.absences import absences
from handscope.sessions.files.recording import LoadedRecording


def shortfalls(recording: LoadedRecording) -> Iterator[str]:
    """A sentence each."""
    for name, stretches in absences(recording).items():
        for start, stop in stretches:
            yield f"{name} was absent from {start:.1f} s to {stop:.1f} s ({stop - start:.1f} s)"
    yield from recording.warnings
