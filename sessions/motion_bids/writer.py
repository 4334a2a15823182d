"""Write a recording as Motion-BIDS, a folder or a zip, so that any program of the field can read it and reading it back gives the same numbers."""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handscope.estimators.data.magnet_declaration import table_of as table_of_plate
from handscope.estimators.data.samples import (
    ACC,
    COMPONENTS,
    FORCE,
    GYR,
    MAG,
    ORIENTATION,
    TORQUE,
    Block,
    Event,
)
from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import ForceSetup
from handscope.estimators.force.setup import setup_to_table as table_of_force
from handscope.estimators.hand.geometry import table_of
from handscope.estimators.messages.system import describe
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.tables_io.number_table import Data, NumberTable, pieces
from handscope.sessions.tables_io.writing import save_file, save_folder

BIDS_VERSION = "1.10.0"
TYPES = {
    GYR: ("GYRO", "rad/s"),
    ACC: ("ACCEL", "m/s^2"),
    MAG: ("MAGN", "T"),
    FORCE: ("MISC", "N"),
    TORQUE: ("MISC", "N*m"),
    ORIENTATION: ("ORNT", "n/a"),
}


def write(
    recording: LoadedRecording,
    path: Path,
    subject: str = "01",
    task: str = "hand",
    session: str | None = None,
    extra: Mapping[str, Data] | None = None,
    software: str = "",
) -> None:
    """Write to a folder or, where the name ends in .zip, a zip; `extra` adds files by relative path."""
    files = {**tree(recording, subject, task, session, software), **(extra or {})}
    if path.suffix == ".zip":
        save_file(pack(files), path)
        return
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError("export.file_in_place_of_folder", path=str(path)) from None
    except OSError as problem:
        raise InputError(
            "table.folder_not_writable", folder=str(path), problem=describe(problem)
        ) from None
    save_folder(files, path)


def tree(
    recording: LoadedRecording,
    subject: str,
    task: str,
    session: str | None = None,
    software: str = "",
) -> dict[str, Data]:
    """All files of the recording by relative path; `software`: the version that writes them."""
    stem = "_".join(
        filter(None, [f"sub-{subject}", f"ses-{session}" if session else "", f"task-{task}"])
    )
    folder = "/".join(
        filter(None, [f"sub-{subject}", f"ses-{session}" if session else "", "motion"])
    )
    files: dict[str, Data] = {
        "dataset_description.json": pretty(_description(recording, software)),
        "README": b"A recording of a hand's movement, written by Handscope.\n",
    }
    for name, block in recording.samples.items():
        base = f"{folder}/{stem}_tracksys-{label(name)}"
        files[f"{base}_motion.tsv"] = NumberTable((block.t, block.values.reshape(len(block.t), -1)))
        files[f"{base}_channels.tsv"] = _channels(block)
        files[f"{base}_motion.json"] = pretty(_sidecar(recording, name, block, task))
    if recording.events:
        files[f"{folder}/{stem}_events.tsv"] = events_table(recording.events)
    return files


def _description(recording: LoadedRecording, software: str) -> dict[str, Any]:
    """What the folder is, what wrote it, and the recording it was written from."""
    found: dict[str, Any] = {
        "Name": "Handscope recording",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
    }
    if software:
        found["GeneratedBy"] = [{"Name": "Handscope", "Version": software}]
    if recording.checksum:
        found["SourceDatasets"] = [{"Version": f"sha256:{recording.checksum}"}]
    return found


def pack(files: Mapping[str, Data]) -> bytes:
    """A zip of files by relative path; the same files give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w") as file:
                file.writelines(pieces(data))
    return buffer.getvalue()


def events_table(events: tuple[Event, ...]) -> bytes:
    """events.tsv: onset, duration, trial_type and a column for every detail that any event has."""
    details = sorted({key for e in events for key in e.details})
    lines = ["\t".join(["onset", "duration", "trial_type", *details])]
    for e in events:
        cells = [
            repr(float(e.onset)),
            repr(float(e.duration)),
            e.trial_type,
            *(e.details.get(key) for key in details),
        ]
        lines.append("\t".join(_cell(cell) for cell in cells))
    return ("\n".join(lines) + "\n").encode()


def _cell(value: Any) -> str:
    """Text of one cell: no tab, no line break, never empty."""
    return "n/a" if value is None else " ".join(str(value).split()) or "n/a"


def pretty(value: Mapping[str, Any]) -> bytes:
    """JSON as it is written into a recording."""
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()


def label(name: str) -> str:
    """A BIDS label: letters and digits only."""
    return "".join(c for c in name if c.isalnum())


def _channels(block: Block) -> bytes:
    lines = [
        "name\tcomponent\ttype\ttracked_point\tunits\tsampling_frequency",
        f"time\tn/a\tLATENCY\tn/a\ts\t{block.stream.rate:g}",
    ]
    for point in block.stream.sensors:
        for quantity in block.stream.quantities:
            kind, unit = TYPES[quantity]
            named = "quat_{}".format if quantity == ORIENTATION else str
            lines += [
                f"{point}_{quantity}_{c}\t{named(c)}\t{kind}\t{point}\t{unit}\t{block.stream.rate:g}"
                for c in COMPONENTS[quantity]
            ]
    return ("\n".join(lines) + "\n").encode()


def _sidecar(recording: LoadedRecording, name: str, block: Block, task: str) -> dict[str, Any]:
    s = block.stream
    kinds = [TYPES[q][0] for q in s.quantities]
    counts = dict.fromkeys((f"{kind}ChannelCount" for kind in kinds), 0)
    for quantity, kind in zip(s.quantities, kinds):
        counts[f"{kind}ChannelCount"] += len(COMPONENTS[quantity]) * len(s.sensors)
    return {
        "TaskName": task,
        "SamplingFrequency": s.rate,
        "TrackingSystemName": name,
        "Manufacturer": str(recording.source.get("manufacturer", "Handscope")),
        **(
            {"ManufacturersModelName": str(recording.source["device"])}
            if recording.source.get("device")
            else {}
        ),
        "DeviceSerialNumber": str(recording.source.get("device_id", "n/a")),
        "SoftwareVersions": str(recording.source.get("software", "n/a")),
        "TrackedPointsCount": len(s.sensors),
        "LATENCYChannelCount": 1,
        **counts,
        "MotionChannelCount": 1 + block.values.shape[1] * block.values.shape[2],
        "MissingValues": "n/a",
        "MeasuredHand": recording.hand,
        "HandGeometry": table_of(recording.geometry),
        "SensorMounting": {
            point: [float(x) for x in recording.mounting[point]]
            for point in s.sensors
            if point in recording.mounting
        },
        **(
            {"MagnetSetup": table_of_plate(recording.plate)}
            if recording.plate and MAG in s.quantities
            else {}
        ),
        **(
            {
                "ForceSetup": {
                    p: table_of_force(ForceSetup(sd, turn_sd=s.turn_sd.get(p)))
                    for p, sd in s.scale_sd.items()
                }
            }
            if s.scale_sd
            else {}
        ),
    }
