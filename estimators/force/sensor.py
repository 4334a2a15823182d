"""What a force sensor's raw readings mean: matrix and offset, told by loads that are known.

In      raw readings (n, k) of k channels under known loads (n, 3) N, or (n, 6) N and Nm
Out     ForceCalibration: loads = matrix @ (raw - offset), with the standard deviation of what it leaves
Source  Kortier, thesis 6.2: channels of a six-axis sensor; least squares: usual for multi-axis sensors. What the offset drifts by while worn: zero.py
Limits  linear: hysteresis and temperature stay in the residuals
"""

from dataclasses import dataclass

import numpy as np

from estimators.errors import InputError
from estimators.quaternions import Array

CONDITION = 50.0  # of the raw readings' spread over their directions, beyond which a direction was hardly loaded; ours


@dataclass(frozen=True)
class ForceCalibration:
    matrix: Array  # (3 or 6, k) N or Nm a raw unit
    offset: Array  # (k,) raw reading of no load
    sd: Array  # (3 or 6,) N or Nm, left over

    def corrected(self, raw: Array) -> Array:
        """Loads (..., 3 or 6) of raw readings (..., k)."""
        return np.asarray((raw - self.offset) @ self.matrix.T)


def calibrated(raw: Array, loads: Array) -> ForceCalibration:
    """By least squares; InputError where the loads do not tell the matrix."""
    if raw.ndim != 2 or loads.ndim != 2 or len(raw) != len(loads) or loads.shape[1] not in (3, 6):
        raise InputError(
            f"readings {raw.shape} and loads {loads.shape} do not belong together; give (n, k) readings and (n, 3) N or (n, 6) loads"
        )
    used = np.isfinite(raw).all(axis=1) & np.isfinite(loads).all(axis=1)
    raw, loads, k = raw[used], loads[used], loads.shape[1]
    if len(raw) < 2 * (k + 1):
        raise InputError(f"{len(raw)} known loads are too few; give at least {2 * (k + 1)}, in all directions")
    if np.linalg.matrix_rank(loads - loads.mean(axis=0)) < k or np.linalg.cond(loads / np.abs(loads).max(axis=0)) > CONDITION:
        raise InputError("the known loads leave a direction out; load the sensor along each axis, both ways")
    design = np.column_stack([loads, np.ones(len(loads))])
    answer, *_ = np.linalg.lstsq(design, raw, rcond=None)  # raw = loads @ C + offset: the loads are exact, the readings noisy
    matrix, offset = np.linalg.pinv(answer[:k].T), answer[k]
    if np.linalg.cond(answer[:k]) > 1e6:
        raise InputError("the readings hardly change with the loads; check that the sensor is connected")
    left = loads - (raw - offset) @ matrix.T
    return ForceCalibration(np.asarray(matrix), np.asarray(offset), np.sqrt((left**2).sum(axis=0) / (len(raw) - k - 1)))
