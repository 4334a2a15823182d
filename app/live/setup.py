"""What a live station is opened with."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from app.protocols import Protocol
from estimators.hand_anatomy import Hand
from estimators.hand_geometry import HandGeometry


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One glove, one session, one method."""

    session: int
    hand: Hand
    geometry: HandGeometry
    port: str
    recording: Path
    method_name: str
    method: ModuleType
    params: Any
    protocols: tuple[Protocol, ...]
    faults: tuple[str, ...] = ()  # of protocol files: those tasks are not offered
    steps: tuple[Protocol, ...] = ()  # of a functional calibration
    about: Mapping[str, Any]  # kept in the recording: pseudonym, session, ...
