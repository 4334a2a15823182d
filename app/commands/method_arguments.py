"""The arguments of verbs that run a method over a recording, and their help: declared without importing a method.

What each method is and which options it has stands in method_help.json, made by `python -P -m handscope.app.commands.method_help`.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from handscope.estimators.hand.sides import HANDS

HELP = "method_help.json"


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that say what recording is meant."""
    parser.add_argument(
        "recording", type=Path, help="a Motion-BIDS folder or zip, or a native recording"
    )
    parser.add_argument(
        "--hand", choices=HANDS, help="the hand measured, where the recording does not say"
    )


def add_method(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that choose a method and its options."""
    known = method_help()
    parser.add_argument(
        "--method",
        metavar="NAME",
        help=f"one of {', '.join(known['methods'])} (default {known['default']}; of orientations alone {known['default_of_orientations']})",
    )
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the method, see below; may be repeated",
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="RECORDING",
        help="take the calibration events from another recording, or what `map` found from its ..._calibration.json",
    )
    parser.epilog_for = _options_help  # type: ignore[attr-defined]  # a Parser of cli.py


@cache
def method_help() -> Mapping[str, Any]:
    """Titles and options of all methods, by name, and which is the default."""
    text = files(__package__).joinpath(HELP).read_text("utf-8")
    found: Mapping[str, Any] = json.loads(text)
    return found


def _options_help(given: Sequence[str]) -> str:
    """The methods, and the options of the one among the words given, or of the default."""
    known = method_help()
    methods, words = known["methods"], [part for word in given for part in word.split("=", 1)]
    asked = next(
        (b for a, b in pairwise(words) if a == "--method" and b in methods), known["default"]
    )
    titles = "\n".join(method["title"] for method in methods.values())
    return f"methods (--method NAME --help lists the options of another):\n{titles}\n\noptions of {asked}:\n{methods[asked]['options']}"
