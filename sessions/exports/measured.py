"""What an export is written from: the movement, the hand, what was measured on it, and where all of it came from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array, Indices
from handscope.sessions.files.recording import LoadedRecording

if TYPE_CHECKING:  # the measures take longer to import than all else here
    from handscope.estimators.measures.assessment import TaskResult

SIMULATED = ("simulated", "virtual")  # words of devices that measured nobody
Files = Mapping[str, bytes]  # by name in a folder; "" is the file itself, ".ending" one beside it


@dataclass(frozen=True, kw_only=True)
class Origin:
    """What a result rests on; every export carries it."""

    software: str
    method: str  # a name of ALL_METHODS
    options: Mapping[str, Any]  # every option of the method, SI
    checksum: str  # sha256 of the recording, "" where unknown
    start_utc: str  # ISO 8601, "" where unknown
    made_utc: str  # ISO 8601, when the export was made
    simulated: bool
    warnings: tuple[str, ...] = ()
    pseudonym: str = ""  # never a name

    def table(self) -> dict[str, Any]:
        """As plain data; an empty pseudonym is left out."""
        about = {
            "software": f"handscope {self.software}",
            "method": self.method,
            "options": dict(self.options),
            "recording_sha256": self.checksum,
            "recording_start_utc": self.start_utc,
            "exported_utc": self.made_utc,
            "simulated": self.simulated,
            "warnings": list(self.warnings),
            "conventions": "angles intrinsic z-x'-y'': flexion +, ulnar deviation +, pronation +; fingertips in the wrist frame",
            "notice": "research use; not a medical device",
        }
        return about | ({"pseudonym": self.pseudonym} if self.pseudonym else {})


@dataclass(frozen=True)
class SkinPart:
    """A closed surface of the hand that follows bones."""

    name: str
    finger: str  # the finger it belongs to, "" of the palm
    vertices: Array  # (v, 3) m, in the hand's frame while bound
    normals: Array  # (v, 3)
    faces: Indices  # (f, 3)
    bones: Indices  # (v, 4) of Skin.bones
    weights: Array  # (v, 4) summing to 1
    colour: tuple[float, float, float]  # linear, 0 to 1


@dataclass(frozen=True)
class Skin:
    """The drawn hand: its parts, and how the bones that carry it turn and lie over time."""

    parts: tuple[SkinPart, ...]
    bones: tuple[str, ...]
    rest: Array  # (bones, 3) m, where the bones' joints are while bound
    turns: Array  # (n, bones, 4) from the bound pose, in the hand's frame
    places: Array  # (n, bones, 3) m, in the hand's frame


SkinMaker = Callable[[HandGeometry, Array], Skin]  # of angles (n, joints, 3), all known


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One recording, and what a method and the measures made of it."""

    recording: LoadedRecording
    movement: Trajectory
    geometry: HandGeometry
    origin: Origin
    tasks: "tuple[TaskResult, ...]" = ()
    report: bytes = b""  # PDF, where a format takes it
    skin: SkinMaker | None = None  # where a format takes it
    # of BIDS
    labels: Mapping[str, str] = field(default_factory=lambda: {"subject": "01", "task": "hand"})


@dataclass(frozen=True)
class Exported:
    """The files of an export, and what is to be known about them."""

    files: Files
    notices: tuple[str, ...] = ()


def is_simulated(source: Mapping[str, Any]) -> bool:
    """Whether a recording's own words say that nobody was measured."""
    words = " ".join(str(value) for value in source.values()).lower()
    return any(word in words for word in SIMULATED)
