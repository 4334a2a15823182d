"""What a live station is opened with."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from handscope.app.protocols import Protocol
from handscope.estimators.data.calibration import Known
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.sessions.clinic.self_calibrations import Found


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One glove, one session, one method."""

    session: int
    hand: Hand
    geometry: HandGeometry
    trunk_height: float | None = (
        None  # m, of the trunk's sensor above the hips, where it was measured
    )
    port: str
    recording: Path
    method_name: str
    method: ModuleType
    params: Any
    protocols: tuple[Protocol, ...]
    faults: tuple[str, ...] = ()  # of protocol files: those tasks are not offered
    steps: tuple[Protocol, ...] = ()  # of a functional calibration
    free: Protocol | None = None  # free movement to calibrate from
    known: Known | None = None  # what the session takes over of an earlier self-calibration
    known_glove: str = ""  # the glove that it was found with
    keep_found: Callable[[Found, str], object] = lambda found, glove: (
        None
    )  # with the patient, when it was accepted
    about: Mapping[str, Any]  # kept in the recording: pseudonym, session, ...

    @property
    def worn(self) -> Mapping[str, float]:
        """How the trunk's sensor is worn, as the event of a reach tells it."""
        return {} if self.trunk_height is None else {"trunk_height": self.trunk_height}
