"""What the station carries out after a step of the wizard; each effect is a value of its own type."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CueTask:
    """A virtual patient does a task; the live curve follows it."""

    task: str


@dataclass(frozen=True)
class CueFinger:
    """A virtual patient bends one finger; "": all of them."""

    finger: str


@dataclass(frozen=True)
class CheckSensors:
    """Look for faults in what has come so far."""


@dataclass(frozen=True)
class Exchange:
    """Read strips for other fingers."""

    worn_on: tuple[tuple[str, str], ...]  # finger that a strip is read for, finger that wears it


@dataclass(frozen=True)
class Correct:
    """Keep a correction of the sensors' readings as an event, and begin again with it."""

    correction: str


@dataclass(frozen=True)
class Calibrate:
    """Compute the calibration from the pose held meanwhile, s."""

    onset: float
    end: float


@dataclass(frozen=True)
class Guess:
    """Go on with an assumed calibration."""


@dataclass(frozen=True)
class DropPose:
    """Forget the newest pose."""


@dataclass(frozen=True)
class KeepAttempt:
    """Keep an attempt at a task as an event."""

    task: str
    onset: float  # s; NaN for a task that was skipped
    end: float
    outcome: str  # "accepted", "redone", "skipped: pain", ...
    score: float | None = None
    pauses: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class MeasureStep:
    """Keep a movement of the calibration as an event, and judge it."""

    task: str
    onset: float
    end: float


@dataclass(frozen=True)
class DropStep:
    """Take back one movement of the calibration."""

    task: str


@dataclass(frozen=True)
class DropSteps:
    """Take back all movements of the calibration."""


@dataclass(frozen=True)
class UseSteps:
    """Combine later poses with the good movements."""


@dataclass(frozen=True)
class WatchFree:
    """Begin the meter of free movement."""

    onset: float


@dataclass(frozen=True)
class SolveFree:
    """Keep the free movement as an event, and solve for the self-calibration."""

    task: str
    onset: float
    end: float


@dataclass(frozen=True)
class LeaveFree:
    """Drop the free movement and its solution."""

    outcome: str  # "redone", "not used"


@dataclass(frozen=True)
class UseFree:
    """Use the self-calibration from the next pose on."""


@dataclass(frozen=True)
class Finish:
    """Close the recording and end the session."""


FreeEffect = WatchFree | SolveFree | LeaveFree | UseFree
Effect = (
    CueTask
    | CueFinger
    | CheckSensors
    | Exchange
    | Correct
    | Calibrate
    | Guess
    | DropPose
    | KeepAttempt
    | MeasureStep
    | DropStep
    | DropSteps
    | UseSteps
    | FreeEffect
    | Finish
)
