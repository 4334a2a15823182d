"""`handscope pose-sheet`: the sheet on which a hand is laid and photographed, as PDF at true scale."""

import argparse
from pathlib import Path

from handscope.app.commands.words import read_json, say
from handscope.app.language import DEFAULT, language, languages
from handscope.app.photograph.printing import print_sheet
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.photograph.sheet import PAPERS, RULER, Sheet
from handscope.sessions.tables_io.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("--hand", choices=HANDS, required=True)
    parser.add_argument("--paper", choices=PAPERS, default="a4", help="a4")
    parser.add_argument(
        "--geometry", type=Path, metavar="FILE.json", help="measures of the hand (HandGeometry)"
    )
    parser.add_argument(
        "--language", choices=[*languages()], default=DEFAULT, help=f"of its words ({DEFAULT})"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.pdf")


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if arguments.out.suffix != ".pdf":
        raise InputError("photograph.pdf_suffix", out=str(arguments.out))
    measures = measures_from(read_json(arguments.geometry)) if arguments.geometry else None
    geometry = sized(arguments.hand, measures)
    sheet = Sheet(arguments.paper, arguments.hand)
    save_file(print_sheet(sheet, geometry, language(arguments.language)), arguments.out)
    say(
        f"{arguments.out}: print it at 100 %; its ruler must be {1e3 * RULER:.0f} mm long. "
        "The outline is of "
        + ("this hand" if arguments.geometry else "an average hand: --geometry gives another")
    )
    return 0
