"""`handscope calibrate-force`: calibrate a fingertip's force sensor by known loads; the result is a `ForceSetup` for the sidecars of its recordings."""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.commands.words import counted, default_data, output_folder, require_file, say
from handscope.app.devices import force_strip
from handscope.app.options import help_text, parse, with_options
from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import AXES, Solved, SolveParams, solve
from handscope.estimators.force.setup import ForceSetup, setup_to_table
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array
from handscope.sessions.formats.load_table import LoadTable, load_table
from handscope.sessions.tables_io import force_calibrations
from handscope.sessions.tables_io.force_calibrations import SETUP
from handscope.sessions.tables_io.writing import save_file

USUAL = 0.025  # sd of the scale that is assumed without a calibration: `force_scale` of force/fingertip_forces.py


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "table",
        type=Path,
        help="CSV: readings of the sensor and the load at each of them, one row a load",
    )
    parser.add_argument(
        "--finger", required=True, choices=FINGERS, help="the fingertip that the sensor is worn on"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.json",
        help="write ForceSetup there; where there is such a file or sidecar the rest of it stays",
    )
    parser.add_argument(
        "--keep",
        metavar="PORT",
        help="keep it for the strip of the glove at this port: applied to what it sends in every live session from now on, and in its recordings",
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=default_data(),
        metavar="DIR",
        help="data folder of --keep (%(default)s)",
    )
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option, see below; may be repeated",
    )
    parser.epilog = (
        f"options:\n{help_text(SolveParams)}\n\nThe table is described in docs/calibration.md."
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    params = with_options(SolveParams, parse(arguments.option))
    out, point = arguments.out, f"{arguments.finger}_tip_force"
    before = _read_existing(out) if out else {}
    table = load_table(arguments.table, params.gravity)
    solved = solve(params, table.raw, table.loads, [f"line {line}" for line in table.lines])
    for line in _summary_lines(table, solved):
        say(line)
    turn = solved.turn_sd if table.by_accelerometer else None
    entry = setup_to_table(
        ForceSetup(solved.calibration.scale_sd, table.channels, solved.calibration, turn)
    ) | _accuracy(table, solved)
    if out:
        _write(out, before, point, entry)
        say(f"{SETUP} of {point}: {out}")
    if arguments.keep:
        strip = force_strip.strip_of(arguments.keep, point, solved.calibration)
        place = force_calibrations.path_of(arguments.data, strip)
        output_folder(place.parent)
        _write(place, _read_existing(place), point, entry)
        say(
            f"kept for strip {strip:x}, {point}: {place}; live sessions that begin from now on apply it"
        )
    return 0


def _write(path: Path, before: dict[str, Any], point: str, entry: dict[str, Any]) -> None:
    setups = {**before.get(SETUP, {}), point: entry}
    save_file(
        (json.dumps({**before, SETUP: setups}, indent=2, ensure_ascii=False) + "\n").encode(), path
    )


def _read_existing(path: Path) -> dict[str, Any]:
    """The content of the file, empty where there is none; InputError where no entry can be added to it."""
    require_file(path)
    if not path.exists():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError("command.not_json", path=str(path), setup=SETUP) from None
    if not isinstance(found, dict) or not isinstance(found.get(SETUP, {}), dict):
        raise InputError("command.not_a_json_object", path=str(path), setup=SETUP)
    return found


def _summary_lines(table: LoadTable, s: Solved) -> list[str]:
    """Residuals of the loads, which loads were left out, and how accurately a force is known."""
    axes = AXES[: len(s.left)]
    left = "; ".join(f"{name} {_with_unit(value, name)}" for name, value in zip(axes, s.left))
    lines = [
        f"{counted(s.used, 'load')} up to {s.heaviest:.3g} N by {counted(len(table.channels), 'channel')}; left over: {left}"
    ]
    for line, raw, load in zip(table.lines, table.raw, table.loads):
        if not (np.isfinite(raw).all() and np.isfinite(load).all()):
            lines.append(phrase("load.line_incomplete", line=line))
    for row in s.left_out:
        load = ", ".join(f"{value:.3g}" for value in table.loads[row])
        lines.append(phrase("load.line_left_out", line=table.lines[row], load=load))
    if s.one_sided:
        lines.append(phrase("load.one_way", axes=", ".join(s.one_sided)))
    lines.append(f"a force is known to {100 * s.calibration.scale_sd:.2g} % of itself")
    if table.by_accelerometer:
        lines.append(
            f"its axes are those of the inertial sensor on the cuff, to {np.degrees(s.turn_sd):.2g} deg"
        )
    if s.calibration.scale_sd > USUAL:
        lines.append(f"warning: {phrase('load.scale_unsure', percent=100 * USUAL)}")
    return lines


def _with_unit(value: float, axis: str) -> str:
    return f"{value:.2g} {'N' if axis.startswith('force') else 'Nm'}"


def _accuracy(table: LoadTable, s: Solved) -> dict[str, Any]:
    """Standard deviations and residuals of the calibration, for readers of the file."""
    return {
        "matrix_sd": _round(s.matrix_sd),
        "offset_sd": _round(s.offset_sd),
        "left_over": _round(s.left),
        "loads": s.used,
        "left_out_lines": [table.lines[row] for row in s.left_out],
    }


def _round(values: Array) -> Any:
    return np.array([float(f"{v:.3g}") for v in values.ravel()]).reshape(values.shape).tolist()
