"""`handscope learn-magnet`: constellation and magnet from a recording of movement, as a
`MagnetSetup` for later ones."""

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
from handscope.estimators.magnet.pipeline.setup_learning import DeclarationErrors, EstimatedSetup
from handscope.estimators.numerics.typing import Array
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file

MM = 1e3
# of the declared standard deviation: a movement that leaves more has hardly observed it
OBSERVED_SHARE = 0.8
OPTIONS = {
    "moment": ("--moment-error", 1.0, "SHARE"),
    "place": ("--place-error", MM, "MM"),
    "places": ("--array-error", MM, "MM"),
}


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "recording",
        type=Path,
        help="half a minute: the hand 10 to 30 cm before the plate, moved and turned, the trunk too",
    )
    parser.add_argument(
        "--hand", choices=HANDS, help="the hand measured, where the recording does not say"
    )
    for option in describe(DeclarationErrors):
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
    """Run the verb; returns the exit code."""
    errors = {
        "moment": arguments.moment_error,
        "place": arguments.place_error / MM,
        "places": arguments.array_error / MM,
    }
    declaration_errors = with_options(DeclarationErrors, errors)
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    estimated = setup_learning.estimate_setup(
        recording.plate, declaration_errors, list(recording.samples.values()), recording.mounting
    )
    assert recording.plate is not None, "without a plate nothing is learnt"
    save_file(
        json.dumps({"MagnetSetup": table_of(estimated.plate)}, indent=2).encode() + b"\n",
        arguments.out,
    )
    for line in _describe(recording.plate, declaration_errors, estimated):
        say(line)
    say(f"MagnetSetup as learnt: {arguments.out}")
    return 0


def _describe(declared: Plate, errors: DeclarationErrors, estimated: EstimatedSetup) -> list[str]:
    """Each quantity: declared, estimated, standard deviation, and whether the movement observed
    it."""
    size, declared_size = (float(np.linalg.norm(p.moment)) for p in (estimated.plate, declared))
    along = np.array(estimated.plate.moment) / size
    cosine = float(along @ np.array(declared.moment)) / declared_size
    lines = [
        f"the hand was followed for {estimated.tracked_share:.0%} of the time",
        f"moment: {declared_size:.3g} A m^2 told, {size:.3g} ± {float(np.sqrt(((along * estimated.moment_sd) ** 2).sum())):.2g} found, "
        f"turned by {np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))):.1f} deg{_hardly_observed(estimated.moment_sd, errors.moment * declared_size)}",
        f"magnet's place: moved by {_distance_mm(declared.place, estimated.plate.place)} ± {_rms_mm(estimated.place_sd)} mm{_hardly_observed(estimated.place_sd, errors.place)}",
    ]
    for name, sd in zip(estimated.magnetometers, estimated.places_sd):
        lines.append(
            f"{name}: moved by {_distance_mm(declared.places[name], estimated.plate.places[name])} ± {_rms_mm(sd)} mm{_hardly_observed(sd, errors.places)}"
        )
    return lines


def _distance_mm(
    declared: tuple[float, float, float], estimated: tuple[float, float, float]
) -> str:
    return f"{MM * float(np.linalg.norm(np.subtract(estimated, declared))):.1f}"


def _rms_mm(sd: Array) -> str:
    return f"{MM * float(np.sqrt((sd**2).mean())):.1f}"


def _hardly_observed(sd: Array, declared_sd: float) -> str:
    return (
        "; this movement hardly told it"
        if float(np.sqrt((sd**2).mean())) > OBSERVED_SHARE * declared_sd
        else ""
    )
