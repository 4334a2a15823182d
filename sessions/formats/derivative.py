"""The derivative of a recording as Motion-BIDS (docs/motion-bids.md): joint angles, fingertips and orientations with what they rest on."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import values_of
from handscope.estimators.fault_detection.finding import Suspicion, Untested
from handscope.estimators.hand.geometry import table_of
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids.writer import BIDS_VERSION, pretty
from handscope.sessions.tables_io.number_table import Data
from handscope.sessions.tables_io.trajectory_table import Column, channels_of
from handscope.sessions.tables_io.trajectory_table import table_of as table_of_trajectory


def tree(
    processed: Processed, recording: LoadedRecording, method: str, params: Any, software: str
) -> dict[str, Data]:
    """All files of the derivative by relative path."""
    folder, stem = _place(recording)
    base = f"{folder}/{stem}_tracksys-handscope_desc-{method.replace('-', '')}"  # BIDS: letters and digits only
    columns, table = table_of_trajectory(processed.trajectory)
    calibration = processed.calibrations[0]
    return {
        "dataset_description.json": pretty(_description(software)),
        f"{base}_motion.tsv": table,
        f"{base}_channels.tsv": channels_of(columns),
        f"{base}_motion.json": pretty(
            _sidecar(processed, recording, method, params, software, columns)
        ),
        f"{base}_calibration.json": pretty(calibration_table(calibration)),
    }


def calibration_table(c: Calibration) -> dict[str, Any]:
    """What the method used or estimated, SI."""
    mounting = {
        s: {
            "q_BS": _plain(q),
            "p_BS": _plain(c.p_BS[s]) if s in c.p_BS else None,
            **({"sd": _plain(c.q_BS_sd[s])} if s in c.q_BS_sd else {}),
            **({"p_BS_sd": _plain(c.p_BS_sd[s])} if s in c.p_BS_sd else {}),
        }
        for s, q in c.q_BS.items()
    }  # sd: rad about the segment's x, y, z
    return {
        "source": c.description,
        "MeasuredHand": c.hand,
        "segment_lengths": {
            s: {"value": length, **({"sd": c.lengths_sd[s]} if s in c.lengths_sd else {})}
            for s, length in c.geometry.lengths.items()
            if s not in ("forearm", "hand")
        },
        "palm_length": {"value": c.geometry.palm_length},
        "sensor_to_segment": mounting,
        "gyr_bias": {s: _plain(b) for s, b in c.gyr_bias.items()},
        "acc_bias": {s: _plain(b) for s, b in c.acc_bias.items()},
        **{
            name: {s: _plain(sd) for s, sd in sds.items()}
            for name, sds in (("gyr_bias_sd", c.gyr_bias_sd), ("acc_bias_sd", c.acc_bias_sd))
            if sds
        },
        "quality": {s: asdict(q) for s, q in c.quality.items()},
        "steps": {step: dict(quality) for step, quality in c.steps.items()},
        "warnings": list(c.warnings),
    }


def _place(recording: LoadedRecording) -> tuple[str, str]:
    inside = str(recording.source.get("recording", "sub-01/motion/sub-01_task-hand"))
    path = PurePosixPath(inside)
    parts = [p for p in path.parts if p.startswith(("sub-", "ses-")) and "_task-" not in p]
    return "/".join([*parts, "motion"]), path.name


def _sidecar(
    processed: Processed,
    recording: LoadedRecording,
    method: str,
    params: Any,
    software: str,
    columns: list[Column],
) -> dict[str, Any]:
    t = processed.trajectory.t
    kinds = ("LATENCY", "JNTANG", "POS", "ORNT", "MISC")
    return {
        "TaskName": str(recording.source.get("task", "hand")),
        "SamplingFrequency": 1.0 / float(np.median(np.diff(t))) if len(t) > 1 else 0.0,
        "TrackingSystemName": "handscope",
        "SoftwareVersions": software,
        "MotionChannelCount": len(columns),
        **{f"{kind}ChannelCount": sum(c[2] == kind for c in columns) for kind in kinds},
        "MeasuredHand": recording.hand,
        "HandGeometry": table_of(processed.calibrations[0].geometry),
        "Conventions": "angles intrinsic z-x'-y'': flexion +, ulnar deviation +, pronation +; quaternions w, x, y, z take segment to global vectors; tips in the wrist frame",
        "method": method,
        "parameters": values_of(params),
        "software_version": software,
        "input_checksum": recording.checksum,
        "calibration_quality": {s: asdict(q) for s, q in processed.calibrations[0].quality.items()},
        "warnings": list(processed.warnings),
        "findings": [finding_table(s) for s in processed.suspicions],
        "untested": untested_table(processed.untested),
    }


def finding_table(suspicion: Suspicion) -> Mapping[str, Any]:
    """A finding of the checks by its code; a span without an end is null there."""
    return {
        "code": suspicion.message.code,
        "severity": suspicion.message.severity,
        "values": dict(suspicion.message.values),
        "sensors": list(suspicion.sensors),
        "spans": [[t if np.isfinite(t) else None for t in span] for span in suspicion.spans],
        "p_value": suspicion.p_value,
    }


def untested_table(untested: Untested) -> Mapping[str, Any]:
    """What the checks could not have found: sensors whose gyroscopes, fingers whose strips, fingers whose places on the hand, and sensors whose turns on their segments the movement does not test."""
    return {f.name: list(getattr(untested, f.name)) for f in fields(untested)}


def _description(software: str) -> Mapping[str, Any]:
    return {
        "Name": "Handscope derivative",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [{"Name": "Handscope", "Version": software}],
    }


def _plain(values: Array) -> list[float]:
    return [float(x) for x in values]
