"""Positions of magnetometers and magnet, and its moment, estimated from half a minute of movement.

In      a recording's blocks; the plate as declared, and its errors; mounting of the sensors
Out     EstimatedSetup: the plate as the movement determines it, with standard deviations
Source  the filter of Kortier's thesis, ch. 5 (tracker.py), with errors of the declared values in
        its state; the thesis measures them with a ruler
Limits  axes of the magnetometers come from turning the plate without a magnet
        (magnetometer_ellipsoid.common_axes); a movement without turning, or far from the plate,
        determines less: the standard deviations say so
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.magnet_declaration import Place, Plate
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import Block
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.pipeline import hand_position
from handscope.estimators.magnet.pipeline.hand_position import PlaceParams
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.state import ERROR, rows
from handscope.estimators.numerics.typing import Array

MIN_TRACKED_SHARE = 0.3  # share of the recording over which the hand must be tracked
MODEL_SHARE = 0.015  # of the moment: errors of the dipole model and of the earth's field
ARM_SD = 0.004  # m: a gyroscope's scale error of 0.3 % looks like this arm (decision 0011)
REFUSED = "the magnet cannot be learnt from this recording"


@dataclass(frozen=True, kw_only=True)
class DeclarationErrors:
    """Standard deviations of the declared plate, in each axis."""

    moment: float = option(
        0.15,
        "1",
        "share of the moment",
        "ours: grades of neodymium, and its direction to 8 deg",
        least=0.001,
        most=0.5,
    )
    place: float = option(
        0.01, "m", "place of the magnet on the hand", "ours: by eye", least=1e-4, most=0.03
    )
    places: float = option(
        0.003, "m", "places of the magnetometers", "ours: by eye", least=1e-4, most=0.03
    )


@dataclass(frozen=True)
class EstimatedSetup:
    """Positions (m) and moment found, with their standard deviations."""

    plate: Plate
    magnetometers: tuple[str, ...]
    moment_sd: Array  # (3,) A m^2, axes of the hand's sensor
    place_sd: Array  # (3,) m
    places_sd: Array  # (magnetometers, 3) m
    tracked_share: float  # share of the recording


def estimate_setup(
    plate: Plate | None,
    errors: DeclarationErrors,
    blocks: Sequence[Block],
    mounting: Mapping[str, Array],
) -> EstimatedSetup:
    """One pass over a recording. InputError where nothing is worn, the hand was hardly tracked, or
    readings contradict everything near the declared values."""
    params = PlaceParams(
        magnet_error=errors.moment, lever_error=errors.place, place_error=errors.places
    )
    s = hand_position.make_setting(params, plate, [b.stream for b in blocks], mounting)
    if s is None or plate is None:
        raise InputError("magnet.no_trunk_magnetometers", refused=REFUSED)
    if len(s.magnetometers) < 2:
        raise InputError("magnet.one_magnetometer", refused=REFUSED)
    state, track = magnet_tracker.step(
        s.params, magnet_tracker.start(s.setup), hand_position.read_recording(s, blocks)
    )
    doubtful, sd = track.doubtful, track.p_sd
    if state.x is None or not len(sd):
        raise InputError("magnet.never_read_together", refused=REFUSED)
    known = np.nan_to_num(sd.max(axis=1), nan=np.inf) < s.params.max_sd
    if known.any() and doubtful[known].mean() > 0.5:
        raise InputError("magnet.readings_contradict_setup", refused=REFUSED)
    if known.mean() < MIN_TRACKED_SHARE:
        raise InputError("magnet.hand_too_far", refused=REFUSED, known=known.mean())
    estimate = magnet_tracker.estimated_setup(state)
    sds, many = np.sqrt(np.maximum(np.diag(state.covariance), 0.0)), 3 * len(s.magnetometers)
    positions = {name: _place(p) for name, p in zip(s.magnetometers, estimate.array.places)}
    declaration = replace(
        plate,
        places={**plate.places, **positions},
        moment=_place(estimate.magnet.moment),
        place=_place(estimate.magnet.place),
    )
    moment_sd, place_sd = (
        np.hypot(sds[rows(ERROR.moment)], MODEL_SHARE * estimate.magnet.size),
        np.hypot(sds[rows(ERROR.lever)], ARM_SD),
    )
    return EstimatedSetup(
        declaration,
        s.magnetometers,
        moment_sd,
        place_sd,
        sds[-1 - many : -1].reshape(-1, 3),
        float(known.mean()),
    )


def _place(values: Array) -> Place:
    x, y, z = (float(v) for v in values)
    return x, y, z
