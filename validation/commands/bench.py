"""`handscope bench`: speed and memory of the hot paths, as ratios to real time."""

import argparse
import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from threadpoolctl import threadpool_limits

from handscope.app.commands.words import say
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.sessions.tables_io.writing import save_file
from handscope.validation.benchmarks import (
    BENCHES,
    Metric,
    bench,
    gate,
    share_of_yardstick,
)


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"some of {', '.join(BENCHES)} (all)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument(
        "--gate",
        nargs="?",
        type=Path,
        const=gate.BASELINE,
        metavar="FILE",
        help="exit code 1 where a figure is worse than the committed baseline allows",
    )
    parser.epilog = "\n".join(f"{name}: {meaning}" for name, meaning in BENCHES.items())


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    unknown = [name for name in arguments.names if name not in BENCHES]
    if unknown:
        raise InputError(
            f"there is no benchmark {unknown[0]!r}; benchmarks are {', '.join(BENCHES)}"
        )
    allowed = gate.read(arguments.gate) if arguments.gate else {}
    found: dict[str, list[Metric]] = {}
    for name in arguments.names or (allowed or BENCHES):
        with threadpool_limits(1):
            found[name] = bench(name)()
        for metric in found[name]:
            say(_line(name, metric, found[name]))
    if {"batch", "cohort", "start"} <= found.keys():
        say(gate.release_row(software_version(), found))
    if arguments.json:
        machine = {
            "version": software_version(),
            "python": platform.python_version(),
            "machine": platform.machine(),
            "system": platform.system(),
        }
        figures = {
            name: [{**asdict(m), "met": m.met} for m in metrics] for name, metrics in found.items()
        }
        save_file(
            (json.dumps({**machine, "benchmarks": figures}, indent=2) + "\n").encode(),
            arguments.json,
        )
    regressions = gate.find_regressions(allowed, found)
    for sentence in regressions:
        say(f"WORSE: {sentence}")
    return 1 if regressions else 0


def _line(name: str, m: Metric, metrics: Sequence[Metric]) -> str:
    sign = "at least" if m.better == "higher" else "at most"
    target = (
        "" if m.target is None else f"   target {sign} {m.target:g}: {'met' if m.met else 'MISSED'}"
    )
    share = share_of_yardstick(m, metrics)
    of = "" if share is None else f"{share:.3g} of the yardstick"
    return f"{name:9} {m.name:36} {m.value:10.4g} {m.unit:12} {of:23}{target}".rstrip()
