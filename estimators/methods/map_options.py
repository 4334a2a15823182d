"""Options of self-calibration by MAP: those of tracking, noise and result, and its own."""

from dataclasses import dataclass

from handscope.estimators.alignment.initial_pose import PoseErrorParams
from handscope.estimators.data.contact_constraint import ContactParams
from handscope.estimators.data.options import option
from handscope.estimators.methods import fusion_pipeline
from handscope.estimators.self_calibration.problem import (
    Noise,
)
from handscope.estimators.self_calibration.result import Requirements


@dataclass(frozen=True, kw_only=True)
class Params(fusion_pipeline.Params, Noise, Requirements, ContactParams, PoseErrorParams):
    """Options of MAP."""

    longest: float = option(
        60.0,
        "s",
        "longest stretch that is calibrated from: the one with most movement",
        "ours: the thesis' 40 s and some more",
        least=5.0,
    )
    least_rate: float = option(
        25.0,
        "Hz",
        "samples used per second in slow movement; fast movement gets ten in a period of its fastest part. Of more frequent samples every second, third and so on is used; gyroscopes count at every sample",
        "ours: docs/decisions/0022-rate-of-self-calibration.md",
        least=10.0,
    )
    length_guess: float = option(
        0.05,
        "1",
        "relative standard deviation of a segment length that the movement does not reveal",
        "Salchow-Hoemmen 2019, 5: ratios vary by a few percents; size ours",
    )
    hand_skin: float = option(
        1.0,
        "1",
        "how far skin moves the hand's sensor with the fingers, before that is known: share of what it was found to do to the fingers' own sensors;"
        " 0 where the hand's sits on something rigid",
        "ours: skin of the back of the hand moves as the fingers' does",
        least=0.0,
    )
    tracked: float = option(
        2.0,
        "deg",
        "standard deviation that tracking adds before and after the stretch",
        "docs/validation/table6.md, m2: 1.8",
    )
