"""The settings of a live station."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from handscope.app.live.readouts.trial_review import EarlierFigures
from handscope.app.protocols import Protocol
from handscope.app.version import software_version
from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry, table_of
from handscope.estimators.pipeline.method import Method
from handscope.sessions.clinic.self_calibrations import FoundCalibration


@dataclass(frozen=True, kw_only=True)
class Setup:
    """One glove, one session, one method."""

    session: int
    continues: int | None = None  # session of the other hand in the same visit, that it follows
    hand: Hand
    geometry: HandGeometry
    # m, of the trunk's sensor above the hips, where it was measured
    trunk_height: float | None = None
    port: str
    recording: Path
    method_name: str
    method: Method[Any, Any]
    params: Any
    protocols: tuple[Protocol, ...]
    plan_title: str = ""  # of the assessment plan whose tasks come first
    faults: tuple[str, ...] = ()  # of protocol files; their tasks are not offered
    steps: tuple[Protocol, ...] = ()  # of a functional calibration
    free: Protocol | None = None  # free movement to calibrate from
    # what the session takes over of an earlier self-calibration
    prior: PriorCalibration | None = None
    prior_glove: str = ""  # device id of its glove
    # with the patient
    store_solution: Callable[[FoundCalibration, str], object] = lambda found, glove: None
    scheduler: str | None = None  # of the cluster that self-calibrates; None: this machine does
    earlier: EarlierFigures = field(default_factory=EarlierFigures)  # what a trial is compared with
    outlets: tuple[str, ...] = ()  # addresses of app/live/outputs/choice.py; none by itself
    about: Mapping[str, Any]  # stored in the recording: pseudonym, session, ...

    @property
    def trunk_details(self) -> Mapping[str, float]:
        """How the trunk's sensor is worn, for the event of a reach."""
        return {} if self.trunk_height is None else {"trunk_height": self.trunk_height}

    @property
    def metadata(self) -> dict[str, Any]:
        """What the recording holds of the session."""
        return {
            "hand": self.hand,
            "geometry": table_of(self.geometry),
            "software": software_version(),
            "port": self.port,
            **self.about,
        }
