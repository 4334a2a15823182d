"""What the patient was doing, and when. Nothing else is here: the process that records needs this
and no numerics."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Event:
    """A stretch of the recording with a meaning (trial_type of the contract: initial_pose, task,
    annotation, ...)."""

    onset: float  # s
    duration: float  # s
    trial_type: str
    # task_name, thumb_cmc_flexion_deg, ...
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def end(self) -> float:
        return self.onset + self.duration
