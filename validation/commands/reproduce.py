"""`handscope reproduce`: the papers' figures measured again, ours beside theirs."""

import argparse
import json
import os
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

from handscope.app.commands.words import output_folder, progress_bar, say
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.sessions.tables_io.writing import save_file, save_folder
from handscope.validation.reproduce import REPRODUCTIONS, Wanted, default_broad_data, reproduction
from handscope.validation.reproduce.experiments import sizes
from handscope.validation.reproduce.finding import Finding, as_json
from handscope.validation.reproduce.layout import (
    as_markdown,
    as_page,
    as_text,
    sizes_as_markdown,
    sizes_as_text,
)
from handscope.validation.reproduce.workers import measured


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"some of {', '.join(REPRODUCTIONS)} (all)"
    )
    parser.add_argument(
        "--seeds",
        type=int,
        default=Wanted.seeds,
        metavar="N",
        help="simulated people (%(default)s; drift: at most 8)",
    )
    parser.add_argument(
        "--experiment",
        action="append",
        default=[],
        metavar="E",
        help="of a reproduction with several experiments only this one; may be repeated",
    )
    parser.add_argument(
        "--minutes",
        type=int,
        default=Wanted.minutes,
        metavar="M",
        help="length of drift (%(default)s)",
    )
    parser.add_argument(
        "--broad-data",
        type=Path,
        default=default_broad_data(),
        metavar="DIR",
        help="the BROAD trials (HANDSCOPE_BROAD, or %(default)s)",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        metavar="J",
        help="processes (as many as cores)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures there")
    parser.add_argument(
        "--markdown",
        type=Path,
        metavar="FOLDER",
        help="write a page for each there, NAME.md",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the drawings (SVG)")
    parser.epilog = "\n".join(f"{name}: {meaning}" for name, meaning in REPRODUCTIONS.items())


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    wanted = _to_wanted(arguments)
    plans = _plans(arguments.names, wanted)
    out = output_folder(arguments.out) if arguments.out else None
    found: list[Finding] = []
    if set(plans) != {"broad"}:
        say(sizes_as_text(sizes()))
    for name, trials in plans.items():
        hear, close = progress_bar(name)
        try:
            results = measured(name, trials, arguments.jobs, hear)
        finally:
            close()
        found.append(reproduction(name).finding(wanted, results))
        say(as_text(found[-1]))
        if out is not None:
            save_folder({file: svg.encode() for file, svg in found[-1].figures.items()}, out)
        if arguments.markdown:
            where = os.path.relpath(out, arguments.markdown) if out else None
            _write_page(
                arguments.markdown, name, as_markdown(found[-1], where), _command(name, wanted)
            )
    if arguments.markdown and any(f.simulated for f in found):
        _write_page(arguments.markdown, sizes().name, sizes_as_markdown(sizes()), "")
    if arguments.json:
        text = {
            "version": software_version(),
            "seeds": wanted.seeds,
            "error_sizes": asdict(sizes())["rows"],
            "reproductions": [as_json(f) for f in found],
        }
        save_file((json.dumps(text, indent=2, ensure_ascii=False) + "\n").encode(), arguments.json)
    return 0


def _to_wanted(arguments: argparse.Namespace) -> Wanted:
    for option in ("seeds", "minutes", "jobs"):
        if getattr(arguments, option) < 1:
            raise InputError(f"--{option} {getattr(arguments, option)} is less than 1")
    unknown = [name for name in arguments.names if name not in REPRODUCTIONS]
    if unknown:
        raise InputError(
            f"there is no reproduction {unknown[0]!r}; reproductions are {', '.join(REPRODUCTIONS)}"
        )
    return Wanted(
        arguments.seeds, tuple(arguments.experiment), arguments.broad_data, arguments.minutes
    )


def _plans(names: Sequence[str], wanted: Wanted) -> dict[str, Sequence[Any]]:
    """The trials of all that is asked for, before anything is computed; what was not named may lack its data."""
    plans: dict[str, Sequence[Any]] = {}
    for name in dict.fromkeys(names or REPRODUCTIONS):
        try:
            plans[name] = reproduction(name).trials(wanted)
        except InputError as problem:
            if names or name != "broad":
                raise
            say(f"broad left out: {problem}\n")
        else:
            if not plans[name]:
                raise InputError(
                    f"{name} has none of the experiments {', '.join(wanted.experiments)}"
                )
    return plans


def _command(name: str, wanted: Wanted) -> str:
    """What was asked for, in the words of the command line."""
    only = "".join(f" --experiment {shlex.quote(e)}" for e in wanted.experiments)
    return f" {name} --seeds {wanted.seeds}{only}"


def _write_page(folder: Path, name: str, section: str, command: str) -> None:
    """One page, with the command that wrote it, the day and the commit."""
    written = (
        f"Written by `handscope reproduce{command}` on {date.today():%Y-%m-%d},"
        f" {_described_commit()}. Do not edit it: run the command again."
    )
    save_file(as_page(section, written).encode(), output_folder(folder) / f"{name}.md")


@cache
def _described_commit() -> str:
    """Which code was run: version and, in a clone, commit."""
    clone = Path(__file__).resolve().parents[2]
    try:
        commit = subprocess.run(
            ["git", "-C", str(clone), "describe", "--always", "--dirty"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return f"version {software_version()}"
    return f"version {software_version()}, commit {commit}"
