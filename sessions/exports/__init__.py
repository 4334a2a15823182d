"""Files that other programs open: one module a format, each with `write(measured) -> Exported`; docs/exports.md lists what each holds and loses."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase

if TYPE_CHECKING:
    from handscope.sessions.exports.measured import Exported, Measured


@dataclass(frozen=True)
class Format:
    """One way out."""

    title: str
    module: str  # of this package
    ending: str  # of the file; "" = a folder
    beside: bool = False  # writes a second file of the same name
    media_type: str = "application/octet-stream"
    report: bool = False  # takes the report's PDF
    skin: bool = False  # takes the drawn hand


FORMATS: Mapping[str, Format] = {
    "bids": Format(phrase("export_title.bids"), "bids", ""),
    "opensim": Format(phrase("export_title.opensim"), "opensim", ""),
    "bvh": Format(phrase("export_title.bvh"), "bvh", ".bvh", beside=True),
    "glb": Format(
        phrase("export_title.gltf"), "glb", ".glb", media_type="model/gltf-binary", skin=True
    ),
    "c3d": Format(phrase("export_title.c3d"), "c3d_points", ".c3d"),
    "mat": Format(phrase("export_title.matlab"), "mat", ".mat"),
    "parquet": Format(phrase("export_title.parquet"), "parquet", ".parquet"),
    "fhir": Format(
        phrase("export_title.fhir"),
        "fhir",
        ".json",
        media_type="application/fhir+json",
        report=True,
    ),
    "redcap": Format(phrase("export_title.redcap"), "redcap", ""),
    "mcap-ros2": Format(phrase("export_title.ros2"), "mcap_ros2", ".mcap"),
    "jsonl": Format(
        phrase("export_title.json_lines"), "jsonl", ".jsonl", media_type="application/jsonl"
    ),
}


def format_of(name: str) -> Format:
    """InputError where there is no such format."""
    if name not in FORMATS:
        raise InputError("export.unknown_format", name=name, names=", ".join(FORMATS))
    return FORMATS[name]


def download_ending(wanted: Format) -> str:
    """Of the one file that a browser gets: several come as a zip."""
    return ".zip" if wanted.beside or not wanted.ending else wanted.ending


def export(measured: "Measured", name: str) -> "Exported":
    """The files of one format."""
    module = import_module(f"{__name__}.{format_of(name).module}")
    made: Exported = module.write(measured)
    return made
