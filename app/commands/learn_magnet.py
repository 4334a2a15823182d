"""`handscope learn-magnet`: the constellation and the magnet's moment and place from a recording of movement, as a `MagnetSetup` for the next ones."""

import argparse
import json
from pathlib import Path

import numpy as np

from handscope.app.commands.words import say
from handscope.app.options import with_options
from handscope.estimators.data.magnet_declaration import Plate, table_of
from handscope.estimators.data.options import describe
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.magnet.pipeline import setup_learning
from handscope.estimators.magnet.pipeline.setup_learning import Learnt, Roughly
from handscope.estimators.numerics.typing import Array
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file

MM = 1e3
HARDLY = 0.8  # of the standard deviation that was told: less than that a movement has not told
OPTIONS = {
    "moment": ("--moment-error", 1.0, "SHARE"),
    "place": ("--place-error", MM, "MM"),
    "places": ("--array-error", MM, "MM"),
}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording",
        type=Path,
        help="half a minute: the hand 10 to 30 cm before the plate, moved and turned, the trunk too",
    )
    parser.add_argument(
        "--hand", choices=HANDS, help="the hand measured, where the recording does not say"
    )
    for option in describe(Roughly):
        name, scale, unit = OPTIONS[option.name]
        text = f"how well that is told, in each axis: {option.meaning} (%(default)g)"
        parser.add_argument(
            name, type=float, default=scale * float(option.default), metavar=unit, help=text
        )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="JSON with MagnetSetup, for the sidecars of other recordings",
    )


def run(arguments: argparse.Namespace) -> int:
    errors = {
        "moment": arguments.moment_error,
        "place": arguments.place_error / MM,
        "places": arguments.array_error / MM,
    }
    roughly = with_options(Roughly, errors)
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    learnt = setup_learning.learnt(
        recording.plate, roughly, list(recording.samples.values()), recording.mounting
    )
    assert recording.plate is not None, "without a plate nothing is learnt"
    save_file(
        json.dumps({"MagnetSetup": table_of(learnt.plate)}, indent=2).encode() + b"\n",
        arguments.out,
    )
    for line in _said(recording.plate, roughly, learnt):
        say(line)
    say(f"MagnetSetup as learnt: {arguments.out}")
    return 0


def _said(told: Plate, roughly: Roughly, learnt: Learnt) -> list[str]:
    """Each quantity: what it was, what it is, how well it is known, and whether the movement told it."""
    size, was = (float(np.linalg.norm(p.moment)) for p in (learnt.plate, told))
    along = np.array(learnt.plate.moment) / size
    cosine = float(along @ np.array(told.moment)) / was
    lines = [
        f"the hand was followed for {learnt.followed:.0%} of the time",
        f"moment: {was:.3g} A m^2 told, {size:.3g} ± {float(np.sqrt(((along * learnt.moment_sd) ** 2).sum())):.2g} found, "
        f"turned by {np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))):.1f} deg{_hardly(learnt.moment_sd, roughly.moment * was)}",
        f"magnet's place: moved by {_moved(told.place, learnt.plate.place)} ± {_rms(learnt.place_sd)} mm{_hardly(learnt.place_sd, roughly.place)}",
    ]
    for name, sd in zip(learnt.magnetometers, learnt.places_sd):
        lines.append(
            f"{name}: moved by {_moved(told.places[name], learnt.plate.places[name])} ± {_rms(sd)} mm{_hardly(sd, roughly.places)}"
        )
    return lines


def _moved(told: tuple[float, float, float], found: tuple[float, float, float]) -> str:
    return f"{MM * float(np.linalg.norm(np.subtract(found, told))):.1f}"


def _rms(sd: Array) -> str:
    return f"{MM * float(np.sqrt((sd**2).mean())):.1f}"


def _hardly(sd: Array, told: float) -> str:
    return (
        "; this movement hardly told it" if float(np.sqrt((sd**2).mean())) > HARDLY * told else ""
    )
