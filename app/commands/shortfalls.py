"""What a recording lacks, in words for the terminal: stretches without a strip, losses on the way, an early end."""

from collections.abc import Iterator

from handscope.estimators.messages.sentence import phrase
from handscope.sessions.files.absences import absences
from handscope.sessions.files.recording import LoadedRecording


def shortfalls(recording: LoadedRecording) -> Iterator[str]:
    """A sentence each."""
    for name, stretches in absences(recording).items():
        for start, stop in stretches:
            yield phrase(
                "recording.strip_absent",
                name=name,
                start=start,
                stop=stop,
                duration=stop - start,
            )
    yield from recording.warnings
