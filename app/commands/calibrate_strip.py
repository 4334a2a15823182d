"""`handscope calibrate-strip`: calibrate the sensors of strips from a recording in which they were laid down in six or more positions, and magnetometers
without an inertial sensor from being turned."""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.commands.method_arguments import add_recording
from handscope.app.commands.words import say
from handscope.app.devices import strip_flash
from handscope.app.options import help_text, parse, with_options
from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors import magnetometer_board
from handscope.estimators.sensors.imu_calibration import CALIBRATED
from handscope.estimators.sensors.six_position_calibration import (
    SolvedCalibration,
    SolveParams,
    solve,
)
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_recording(parser)
    parser.add_argument(
        "--out", type=Path, metavar="FILE.json", help="write the calibrations and how sure they are"
    )
    parser.add_argument(
        "--write", metavar="PORT", help="keep them in the flash of the strips at this port"
    )
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option, see below; may be repeated",
    )
    parser.epilog = f"options:\n{help_text(SolveParams)}"


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    recording = formats_recordings.load(arguments.recording, arguments.hand, correct=False)
    params = with_options(SolveParams, parse(arguments.option))
    solved, refused = _solve(recording, params)
    for problem in refused:
        say(f"warning: {problem}")
    if not solved:
        raise InputError("command.no_sensor_calibrated", name=arguments.recording.name)
    for name, found in solved.items():
        for line in _summary_lines(name, found):
            say(line)
    if arguments.out:
        save_file((json.dumps(_table(recording, solved), indent=2) + "\n").encode(), arguments.out)
        say(f"{len(solved)} calibrations: {arguments.out}")
    if arguments.write:
        written = strip_flash.write(
            arguments.write, {n: s.calibration for n, s in solved.items()}, recording.strip_ids
        )
        say(f"written and read back: {', '.join(written)}")
    return 0


def _solve(
    recording: LoadedRecording, params: SolveParams
) -> tuple[dict[str, SolvedCalibration], list[str]]:
    """By sensor; and why others could not be solved."""
    solved: dict[str, SolvedCalibration] = {}
    refused: list[str] = []
    for block in recording.samples.values():
        for k, name in enumerate(block.stream.sensors if block.stream.inertial else ()):
            try:
                solved[name] = solve(
                    params,
                    name,
                    block.t,
                    block.of(GYR)[:, k],
                    block.of(ACC)[:, k],
                    *_magnetometer(recording, name),
                )
            except InputError as problem:
                refused.append(str(problem))
    inertial = {
        name
        for block in recording.samples.values()
        if block.stream.inertial
        for name in block.stream.sensors
    }
    for block in recording.samples.values():
        alone = [
            k
            for k, name in enumerate(block.stream.sensors)
            if MAG in block.stream.quantities and name not in inertial
        ]
        if alone:
            names = [block.stream.sensors[k] for k in alone]
            q_BS = np.array([recording.mounting.get(name, quat.IDENTITY) for name in names])
            plate = magnetometer_board.calibrate_board(names, block.of(MAG)[:, alone], q_BS)
            solved |= plate.solved
            refused += plate.refused
            if plate.solved:
                say(
                    f"{', '.join(plate.solved)}: the field has {1e6 * plate.strength:.2f} uT here, that is `earth` of MagnetSetup"
                )
    return solved, refused


def _magnetometer(recording: LoadedRecording, name: str) -> tuple[Array | None, Array | None]:
    for block in recording.samples.values():
        if MAG in block.stream.quantities and name in block.stream.sensors:
            return block.t, block.of(MAG)[:, block.stream.sensors.index(name)]
    return None, None


def _summary_lines(name: str, s: SolvedCalibration) -> list[str]:
    units = {
        GYR: (180 / np.pi, "deg a turn"),
        ACC: (1.0, "m/s^2 at rest"),
        MAG: (100.0, "% of the field"),
    }
    left = [
        f"{q} {units[q][0] * before:.3f} -> {units[q][0] * after:.3f} {units[q][1]}"
        for q in CALIBRATED
        if q in s.residuals
        for before, after in [s.residuals[q]]
    ]
    how = f"{s.positions} positions, {s.turns} turns" if s.positions else "turned by hand"
    return [
        f"{name}: {how}; {'; '.join(left)}",
        *(f"  not observed: {what}" for what in s.unobserved),
    ]


def _table(recording: LoadedRecording, solved: dict[str, SolvedCalibration]) -> dict[str, Any]:
    """As docs/calibration.md describes."""
    return {
        "recording": recording.checksum,
        "sensors": {
            name: {
                "strip_id": recording.strip_ids.get(name),
                "positions": s.positions,
                "turns": s.turns,
                "not_observed": list(s.unobserved),
                **{
                    q: {
                        "bias": s.calibration.bias[q].tolist(),
                        "matrix": s.calibration.matrix[q].tolist(),
                        "bias_sd": _plain(s.bias_sd[q]),
                        "matrix_sd": _plain(s.matrix_sd[q]),
                        "residual_before": s.residuals[q][0],
                        "residual_after": s.residuals[q][1],
                    }
                    for q in s.calibration.matrix
                },
            }
            for name, s in solved.items()
        },
    }


def _plain(values: Array) -> Any:
    """Numbers as lists, null where not observed: JSON has no infinity."""
    return [_plain(v) if np.ndim(v) else float(v) if np.isfinite(v) else None for v in values]
