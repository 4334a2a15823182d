"""`handscope photograph`: lengths and angles of a hand from a photograph of it on the printed sheet."""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.commands.words import read_json, say
from handscope.app.photograph.pictures import LARGEST, Photograph, measure_hand, open_photograph
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.messages.system import describe
from handscope.estimators.photograph.hand_figures import Figures
from handscope.estimators.photograph.use import geometry_entries, pose_details
from handscope.sessions.tables_io.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "pictures",
        type=Path,
        nargs="+",
        metavar="PICTURE",
        help="JPEG or PNG, from above, whole sheet in it; several of the hand as it lies, from different sides, tell more exactly",
    )
    parser.add_argument("--hand", choices=HANDS, required=True)
    parser.add_argument(
        "--ruler", type=float, metavar="MM", help="length of the printed ruler, if not 100 mm"
    )
    parser.add_argument(
        "--geometry", type=Path, metavar="FILE.json", help="measures of the hand (HandGeometry)"
    )
    todo = parser.add_mutually_exclusive_group(required=True)
    todo.add_argument(
        "--propose",
        type=Path,
        metavar="MARKS.json",
        help="write where the landmarks will be in the picture, pixels; correct them there",
    )
    todo.add_argument(
        "--marks",
        type=Path,
        nargs="+",
        metavar="MARKS.json",
        help="the corrected landmarks, of each picture",
    )
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write geometry and the pose's columns there"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    marks = arguments.marks or [arguments.propose]
    if len(marks) != len(arguments.pictures):
        raise InputError(
            "photograph.marks_of_each", pictures=len(arguments.pictures), marks=len(marks)
        )
    photographs = [_open(picture, arguments) for picture in arguments.pictures]
    for photograph in photographs:
        say(
            f"{photograph.markers} markers, {np.degrees(photograph.camera.tilt):.0f} deg from above, "
            f"markers within {1e3 * photograph.camera.misfit:.1f} mm"
        )
    if arguments.propose:
        _propose(photographs[0], arguments)
        return 0
    figures = measure_hand(list(zip(photographs, map(read_json, marks))))
    say(_as_text(figures))
    if arguments.json:
        found = {"geometry": geometry_entries(figures), "initial_pose": pose_details(figures)}
        save_file((json.dumps(found, indent=2) + "\n").encode(), arguments.json)
    return 0


def _propose(photograph: Photograph, arguments: argparse.Namespace) -> None:
    measures = measures_from(read_json(arguments.geometry)) if arguments.geometry else None
    places = photograph.proposed(sized(arguments.hand, measures))
    marks = {name: [round(float(x), 1) for x in at] for name, at in places.items()}
    save_file((json.dumps(marks, indent=2) + "\n").encode(), arguments.propose)
    say(f"{len(marks)} landmarks proposed: {arguments.propose}")


def _open(picture: Path, arguments: argparse.Namespace) -> Photograph:
    try:
        if picture.stat().st_size > LARGEST:
            raise InputError("photograph.too_large", most=LARGEST / 2**20)
        data = picture.read_bytes()
    except OSError as problem:
        raise InputError(
            "photograph.file_unreadable", name=str(picture), problem=describe(problem)
        ) from None
    ruler = None if arguments.ruler is None else 1e-3 * arguments.ruler
    return open_photograph(data, arguments.hand, ruler)


def _as_text(figures: Figures) -> str:
    """One line a length and angle."""
    lengths = _rows(figures.lengths, figures.lengths_sd, 1e3, "mm", "")
    angles = _rows(figures.deviation, figures.deviation_sd, 180 / np.pi, "deg", " deviation")
    return "\n".join([*lengths, *angles])


def _rows(
    values: Mapping[str, float], sd: Mapping[str, float], scale: float, unit: str, what: str
) -> list[Any]:
    return [
        f"{name.replace('_', ' ') + what:24s} {scale * value:7.1f} +- {scale * sd[name]:.1f} {unit}"
        for name, value in values.items()
    ]
