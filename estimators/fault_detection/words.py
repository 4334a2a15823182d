"""The checks' messages as sentences, and suspicions as findings that have them."""

from collections.abc import Sequence
from dataclasses import replace

from handscope.estimators.data.findings import Finding
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.messages import Message, Value
from handscope.estimators.messages.sentence import Sentence


def sentence(message: Message) -> str:
    """A message in words, its numbers to three digits."""
    values = {name: _rounded(value) for name, value in message.values.items()}
    return Sentence(replace(message, values=values))


def as_findings(suspicions: Sequence[Suspicion]) -> list[Finding]:
    """A finding for each sensor of each suspicion, with the same sentence; questions about the person flag nothing and are left out."""
    return [
        Finding(
            sensor=sensor,
            kind=s.message.code,
            sentence=sentence(s.message),
            fix="",
            severity="fault" if s.message.severity == "fault" else "warning",
            spans=tuple((float(begin), float(end)) for begin, end in s.spans),
        )
        for s in suspicions
        if s.message.severity != "info"
        for sensor in s.sensors
    ]


def _rounded(value: Value) -> Value:
    return value if isinstance(value, str) else float(f"{value:.3g}")
