"""Calibrate magnetometers that have no inertial sensor beside them, rigid on one plate that was
turned through all directions.

In      readings (n, magnetometers, 3) T at the same instants, the nominal turn of each against the
        plate
Out     Solved by magnetometer: hard and soft iron of each, one strength of the field, axes that
        agree with the first one's; why others could not be
Source  magnetometer_ellipsoid.py (Kok & Schoen 2016; Kortier, thesis 5.2.4)
Limits  how the first is turned against the trunk's inertial sensor stays as its mounting says; a
        magnetometer alone is its own first
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.samples import MAG
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.imu_calibration import ImuCalibration
from handscope.estimators.sensors.magnetometer_ellipsoid import (
    EllipsoidCalibration,
    find_common_axes,
    find_outsiders,
    fit_ellipsoid,
)
from handscope.estimators.sensors.six_position_calibration import SolvedCalibration

AGAINST_GRAVITY = phrase("sensor.unobserved_gravity")


@dataclass(frozen=True)
class BoardCalibration:
    """Calibration of all magnetometers of a board that was turned."""

    solved: Mapping[str, SolvedCalibration]  # by magnetometer
    refused: Sequence[str]
    strength: float  # T, of the field as all of them now read it; NaN where none was solved


def calibrate_board(names: Sequence[str], mag: Array, q_BS: Array) -> BoardCalibration:
    """q_BS (magnetometers, 4) takes vectors from each magnetometer's axes to the plate's, as
    nominally mounted."""
    spheres: dict[str, EllipsoidCalibration] = {}
    refused = []
    for k, name in enumerate(names):
        try:
            spheres[name] = fit_ellipsoid(mag[:, k], name)
        except InputError as problem:
            refused.append(str(problem))
    if not spheres:
        return BoardCalibration({}, refused, float("nan"))
    strength = float(np.mean([s.strength for s in spheres.values()]))
    rows = [list(names).index(name) for name in spheres]
    nominal = q_BS[rows]
    share = {name: strength / s.strength for name, s in spheres.items()}
    own = np.stack(
        [share[name] * s.corrected(mag[:, k]) for k, (name, s) in zip(rows, spheres.items())],
        axis=1,
    )
    common = find_common_axes(quat.rotate(nominal, own))
    outsiders = find_outsiders(tuple(spheres), common)
    R = quat.matrix(quat.multiply(quat.conjugate(nominal), quat.multiply(common.q_1l, nominal)))
    solved = {
        name: _turn_sphere(s, share[name], sign * turn)
        for (name, s), sign, turn in zip(spheres.items(), common.signs, R)
        if name not in outsiders
    }
    return BoardCalibration(solved, [*refused, *outsiders.values()], strength)


def _turn_sphere(s: EllipsoidCalibration, share: float, turn: Array) -> SolvedCalibration:
    """With the matrix (3, 3) of the sphere turned, and mirrored where the magnetometer is, so that
    all of the plate agree."""
    calibration = ImuCalibration({MAG: share * turn @ s.matrix}, {MAG: s.bias})
    return SolvedCalibration(
        calibration,
        {MAG: share * s.matrix_sd},
        {MAG: s.bias_sd},
        {MAG: (s.before, s.after)},
        positions=0,
        turns=0,
        unobserved=(AGAINST_GRAVITY,),
    )
