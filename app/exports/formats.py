"""The formats that a processed recording can be handed out in: a new one is a file beside this and a line here."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from handscope.sessions.tables_io.writing import save_file, save_folder

if TYPE_CHECKING:
    from handscope.app.results.export_content import Content

Written = bytes | Mapping[str, bytes]  # one file, or the files of a folder by name


@dataclass(frozen=True)
class Format:
    """One way to hand a movement out."""

    title: str
    suffix: str  # of the file; "" for a folder
    module: str  # of this room; its `write` makes it. Imported when it is asked for


FORMATS: Mapping[str, Format] = {
    "opensim": Format("OpenSim: angles, orientations, model of the hand", "", "opensim"),
    "bvh": Format("BVH: animated skeleton", ".bvh", "bvh"),
    "glb": Format("glTF: animated hand", ".glb", "glb"),
    "c3d": Format("C3D: joint centres, fingertips, angles, events", ".c3d", "c3d_file"),
    "mat": Format("MATLAB: columns with units", ".mat", "matlab"),
    "parquet": Format("Parquet: columns with units", ".parquet", "parquet"),
    "fhir": Format("FHIR R4: figures and report for a record system", ".json", "fhir"),
    "redcap": Format("REDCap: figures and data dictionary", "", "redcap"),
    "mcap-ros2": Format("ROS 2: joint states, transforms, fingertips", ".mcap", "ros2"),
    "jsonl": Format("JSON lines: a line a sample", ".jsonl", "jsonl"),
}


def written(content: "Content", name: str) -> Written:
    """What a format makes of a recording; InputError where nothing can be made of it."""
    content.require_movement()
    made: Written = import_module(f"handscope.app.exports.{FORMATS[name].module}").write(content)
    return made


def save(content: "Content", name: str, path: Path) -> list[str]:
    """Write it whole or not at all; sentences about what the format could not hold."""
    data = written(content, name)
    if isinstance(data, bytes):
        save_file(data, path)
    else:
        path.mkdir(parents=True, exist_ok=True)
        save_folder(data, path)
    missing = content.missing_joints()
    return [f"not measured, and left out or held straight: {', '.join(missing)}"] if missing else []
