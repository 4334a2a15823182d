"""How far leaning carries the trunk's sensor forward: of a rigid trunk that leans about the hips, from its orientation alone.

In      orientations of the trunk q_trunk (n, 4) (x forward, y up, z right; the global z up) and their standard deviations (n, 3) rad, the sensor's height
        above the hips
Out     displacement (n,) m from where it is first, along the horizontal direction that the trunk faces there, backward negative; standard deviation (n,)
Source  the quantity: sagittal displacement of a marker on the breastbone, Levin et al. 2002, Exp Brain Res 143:171. The model is ours:
        s = h f'(R R_0' e_z), with the sensor straight above the hips at first; f is where the trunk faces there, h its height
Limits  who bends in the back more than at the hips is carried less far than computed; turning about the vertical carries the shoulder, not the breastbone, and is
        not in it; sliding on the chair is not seen
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

WINTER = "hip 0.530, chest 0.720, shoulder 0.818 of the stature (Winter 2009, Fig. 4.1, after Drillis & Contini 1966): half way up the breastbone 0.24 of 1.68 m"
GIVEN_SD = 0.02  # m, of a height that was measured with a tape
LEAST, MOST = 0.1, 0.7  # m, of a height


@dataclass(frozen=True, kw_only=True)
class TrunkParams:
    """Height and slope of the trunk, with what they are known to."""

    trunk_height: float = option(0.40, "m", "height of the trunk's sensor above the axis of the hips, where none is told", WINTER, least=LEAST, most=MOST)  # fmt: skip
    trunk_height_sd: float = option(
        0.05,
        "m",
        "and its error",
        "ours: statures (0.03), where on the breastbone and about which axis it leans (0.04)",
        least=0.0,
    )
    trunk_slope_sd: float = option(
        10.0,
        "deg",
        "by how much the line from hips to sensor may stand inclined at the beginning",
        "ours: how people sit",
        least=0.0,
    )


@dataclass(frozen=True)
class Displacement:
    """Forward displacement with its standard deviation, m."""

    forward: Array  # (n,) m
    sd: Array  # (n,) m


def declared_height(details: Mapping[str, Any]) -> float | None:
    """The height above the hips that a task's details tell, m; None where they tell none, NaN where it cannot be one."""
    declared = details.get("trunk_height")
    if declared in (None, "", "n/a"):
        return None
    try:
        height = float(str(declared))
    except ValueError:
        return float("nan")
    return height if LEAST <= height <= MOST else float("nan")


def displacement(
    params: TrunkParams, q_trunk: Array, q_trunk_sd: Array, given: float | None
) -> Displacement:
    """From the first of the orientations on, where it is zero; `given` is the sensor's height above the hips where it was measured, m."""
    height, height_sd = (
        (params.trunk_height, params.trunk_height_sd) if given is None else (given, GIVEN_SD)
    )
    first = q_trunk[0]
    facing = quat.rotate(first, np.array([1.0, 0.0, 0.0])) * [1.0, 1.0, 0.0]
    facing = facing / max(float(np.linalg.norm(facing)), 1e-9)
    turned = quat.multiply(q_trunk, np.tile(quat.conjugate(first), (len(q_trunk), 1)))
    above = quat.rotate(turned, np.tile([0.0, 0.0, 1.0], (len(q_trunk), 1)))
    share, upright = above @ facing, above[:, 2]
    leans = np.sqrt((q_trunk_sd**2).mean(axis=1))
    sloped = np.radians(params.trunk_slope_sd) * (1.0 - upright)
    sd = np.sqrt(
        (share * height_sd) ** 2 + (height * upright * leans) ** 2 + (height * sloped) ** 2
    )
    return Displacement(np.asarray(height * share), np.asarray(sd))
