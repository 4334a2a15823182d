"""`handscope import`: a table of any logger as a native recording, by a map of its columns; or a first guess of that map."""

import argparse
import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from handscope.app.commands.words import require_file, say
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.messages import render_english
from handscope.sessions.files import native
from handscope.sessions.motion_bids.events_reader import read_events
from handscope.sessions.table_import.column_map import as_json, read_map
from handscope.sessions.table_import.guess import guess_map
from handscope.sessions.table_import.importing import import_table
from handscope.sessions.tables_io.writing import save_file

T = TypeVar("T")
ENDS_ITS_READER = ".mat"  # where it is damaged: SciPy's reader then ends the process


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "table",
        type=Path,
        help="CSV, TSV, XLSX, Parquet, MAT, XDF or a maker's format, a row a sample",
    )
    parser.add_argument("--map", type=Path, metavar="MAP.json", help="which columns are what")
    parser.add_argument("--guess", type=Path, metavar="MAP.json", help="write a first map there")
    parser.add_argument(
        "--events",
        type=Path,
        metavar="EVENTS.tsv",
        help="poses and tasks as in Motion-BIDS; onset in s from the first row",
    )
    parser.add_argument("--out", type=Path, metavar="REC.mcap", help="the native recording")


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if not arguments.table.is_file():
        raise InputError("reference.not_file", name=arguments.table)
    if (arguments.guess is None) == (arguments.map is None):
        raise InputError("command.guess_or_map")
    return _guess(arguments) if arguments.guess else _convert(arguments)


def _guess(arguments: argparse.Namespace) -> int:
    require_file(arguments.guess)
    columns, open_questions = _read(arguments.table, guess_map, arguments.table)
    save_file(as_json(columns).encode(), arguments.guess)
    mapped = sum(len(s.channels) for s in columns.sensors.values())
    say(f"{len(columns.sensors)} sensors, {mapped} quantities: {arguments.guess}")
    for question in open_questions:
        say(f"to fill in: {question}")
    return 0


def _convert(arguments: argparse.Namespace) -> int:
    out = arguments.out
    if out is None or out.suffix != native.SUFFIX or out.exists():
        raise InputError("command.out_not_new", out=out, suffix=native.SUFFIX)
    require_file(out)
    columns = read_map(arguments.map)
    events = read_events(arguments.events) if arguments.events else ()
    about = {"software": software_version(), "imported_from": arguments.table.name}
    found = _read(arguments.table, import_table, arguments.table, columns, events, out, about)
    for message in found.messages:
        say(f"{'warning: ' * (message.severity == 'warning')}{render_english(message)}")
    say(f"{found.duration:.1f} s of {len(columns.sensors)} sensors at {found.rate:.4g} Hz: {out}")
    return 0


def _read(table: Path, work: Callable[..., T], *arguments: object) -> T:
    """What `work` finds in the table; InputError where it refuses, or the file ends its reader."""
    if table.suffix.lower() != ENDS_ITS_READER:
        return work(*arguments)
    from handscope.app.workers.upload_reader import UploadReader  # loads the server's modules

    with UploadReader() as reader:
        return asyncio.run(reader.call(work, *arguments))
