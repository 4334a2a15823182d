"""A finding of the checks: what is probably wrong with a recording, how sure that is, and when."""

from collections.abc import Mapping
from dataclasses import dataclass

from handscope.estimators.messages import Message as Message
from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True)
class Untested:
    """What the checks could not have found, for want of movement."""

    gyroscopes: tuple[str, ...] = ()  # tracked points
    strips: tuple[str, ...] = ()  # fingers, for a delay
    fingers: tuple[str, ...] = ()  # for an exchange of two of them
    turns: tuple[str, ...] = ()  # tracked points, for a turn that the gyroscope sees

    @property
    def messages(self) -> tuple[Message, ...]:
        """What is said of it, as information."""
        parts = (
            ("checks.untested_gyroscopes", "sensors", self.gyroscopes),
            ("checks.untested_strips", "fingers", self.strips),
            ("checks.untested_fingers", "fingers", self.fingers),
            ("checks.untested_turns", "sensors", self.turns),
        )
        return tuple(
            Message(code, {name: ", ".join(found)}, "info") for code, name, found in parts if found
        )


NOTHING_UNTESTED = Untested()


@dataclass(frozen=True)
class Suspicion:
    """One fault of sensors, or of the file, that the data show."""

    message: Message
    sensors: tuple[str, ...]  # tracked points; all of them where the file is at fault
    spans: tuple[tuple[float, float], ...]  # s, when it holds
    p_value: float  # probability of evidence as strong without the fault
    correction: Mapping[str, object] | None = (
        None  # where the data leave one answer: e.g. {"gyr": matrix (3, 3)}, {"delay": s}, {"exchange": ("a", "b")}
    )
    rates: Array | None = None  # (3, 3) that makes rates of what a faulty gyroscope reads
