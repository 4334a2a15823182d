"""Calibration of a force sensor: matrix and offset from known loads.

In      raw readings (n, k) of k channels under known loads (n, 3) N, or (n, 6) N and Nm, as a fingertip would exert them, in the sensor's frame
Out     Solved: loads = matrix @ (raw - offset) with standard deviations, what is left over, which loads were left out
Source  Kortier, thesis 6.2: channels of a six-axis sensor; least squares with errors in the readings alone: usual for multi-axis sensors. A load that does not
        belong: the fall of the sum of squares without it (Cook & Weisberg 1982, Residuals and Influence in Regression, 2.2). What the offset drifts by while worn: zero.py
Limits  linear: what is not (hysteresis, temperature, saturation) stays in the residuals, and they count as an error of the scale
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.options import option
from handscope.estimators.errors import InputError
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools

AXES = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
NOTHING = "no load"
CONDITION = 50.0  # of the loads' spread over their directions, beyond which a direction was hardly loaded; ours
SPARE = 3  # loads beyond the unknowns of a channel that are needed at least: six positions of a sensor with three axes, and no load
STUCK = 3  # equal readings at the end of a sensor's range in a row
REPEATED = 0.5  # share of readings that equal the one before
COARSE = 0.1  # share of axes, or of readings, that are what they were before
LUCK = 0.01  # chance that a recording shows a sensor that repeats itself for longer
FAR = 1.0  # N from the level at rest
DISCARDED = 0.2  # share of the loads that may be left out


@dataclass(frozen=True, kw_only=True)
class SolveParams:
    """Options of the calibration from known loads, N."""

    load_error: float = option(
        0.005,
        "1",
        "share by which all known loads may be wrong alike",
        "ours: weights of a kitchen, places to a millimetre",
        least=0.0,
    )
    chance: float = option(
        1e-3,
        "1",
        "chance of luck below which a load that does not fit the others is left out",
        "ours",
        least=0.0,
        most=0.1,
    )
    worst: float = option(
        0.1,
        "1",
        "share by which forces may be wrong, beyond which the calibration is refused",
        "ours",
        least=0.01,
    )
    level: float = option(
        0.3,
        "deg",
        "error of the directions that an accelerometer tells",
        "ours: a bias of 0.05 m/s^2",
        least=0.0,
        most=10.0,
    )
    gravity: float = option(
        GRAVITY,
        "m/s^2",
        "of the place where the weights hung",
        "standard gravity",
        least=9.7,
        most=9.9,
    )


@dataclass(frozen=True)
class ForceCalibration:
    """Loads are the matrix times what the raw channels read beyond their offset."""

    matrix: Array  # (3 or 6, k) N or Nm a raw unit
    offset: Array  # (k,) raw reading of no load
    scale_sd: float  # share of a force by which it may be wrong in all samples alike

    def corrected(self, raw: Array) -> Array:
        """Loads (..., 3 or 6) of raw readings (..., k); NaN of a reading that is missing in part."""
        return np.asarray((raw - self.offset) @ self.matrix.T)

    def clipped(self, raw: Array) -> Bools:
        """Which readings (n,) have a channel at the end of its range; mixing the channels would hide that."""
        return is_stuck(raw * np.linalg.norm(self.matrix[:3], axis=0))


@dataclass(frozen=True)
class Solved:
    """A calibration with its standard deviations and what it leaves, N."""

    calibration: ForceCalibration
    matrix_sd: Array  # (3 or 6, k)
    offset_sd: Array  # (k,)
    left: Array  # (3 or 6,) N or Nm, standard deviation of what is left over
    used: int  # loads
    left_out: tuple[int, ...]  # rows of loads that do not belong to the others
    one_sided: tuple[str, ...]  # axes that were loaded one way alone
    heaviest: float  # N
    turn_sd: float  # rad about each axis, error of the frame of the loads where an accelerometer measured their directions


def solve(params: SolveParams, raw: Array, loads: Array, names: Sequence[str] = ()) -> Solved:
    """By least squares, without loads that do not belong; InputError where the loads do not tell the matrix, with the loads' names where they have some."""
    if raw.ndim != 2 or loads.ndim != 2 or len(raw) != len(loads) or loads.shape[1] not in (3, 6):
        raise InputError("force.readings_shape", shape=str(raw.shape), shape2=str(loads.shape))
    rows = np.flatnonzero(np.isfinite(raw).all(axis=1) & np.isfinite(loads).all(axis=1))
    m, most = loads.shape[1], int(DISCARDED * len(rows))
    _require(raw[rows], loads[rows])
    left_out: list[int] = []
    while len(left_out) < most and len(
        strange := _outlying_rows(params.chance, raw[rows], loads[rows])
    ):
        if len(strange) > 1:
            both = _describe_rows(sorted(int(row) for row in rows[strange[:2]]), names)
            raise InputError("force.rows_contradict", both=both)
        left_out.append(int(rows[strange[0]]))
        if len(left_out) > 1 and len(rows) + len(left_out) - 1 < m + 1 + SPARE * (
            len(left_out) + 1
        ):
            left_out_rows = _describe_rows(sorted(left_out), names)
            raise InputError("force.rows_do_not_fit", left_out_rows=left_out_rows)
        rows = np.delete(rows, strange[0])
        _require(raw[rows], loads[rows])
    raw, loads = raw[rows], loads[rows]
    design = _design(loads)
    # raw = loads @ C + offset: the loads are exact, the readings noisy
    answer, *_ = np.linalg.lstsq(design, raw, rcond=None)
    matrix, offset = np.asarray(np.linalg.pinv(answer[:m].T)), np.asarray(answer[m])
    free = len(raw) - m - 1
    missed = raw - design @ answer
    left_over = matrix @ (missed.T @ missed / free) @ matrix.T  # (m, m) of one reading, as a load
    # Student's: the noise is known from so few alone
    unknown = np.asarray(np.linalg.inv(design.T @ design)) * free / (free - 2)
    # dM = -M dC' M
    matrix_sd = np.sqrt(np.outer(np.diag(left_over), np.diag(matrix.T @ unknown[:m, :m] @ matrix)))
    offset_sd = np.sqrt(unknown[m, m] * (missed**2).sum(axis=0) / free)
    left = np.asarray(np.sqrt(np.diag(left_over)))
    missed_share = _scale_sd(loads, left, unknown[:m, :m])
    # of the matrix's nine entries, alike: the force's own direction takes one of each row
    each = missed_share / np.sqrt(3.0)
    scale = float(np.hypot(each, params.load_error))
    # the halves that turn
    turn = float(np.hypot(_turn_by_bias(loads, params.level * np.pi / 180), each / np.sqrt(2.0)))
    if (whole := float(np.hypot(missed_share, params.load_error))) > params.worst:
        raise InputError("force.readings_do_not_follow_loads", whole=100 * whole)
    one_sided = tuple(AXES[a] for a in range(m) if min(loads[:, a].max(), -loads[:, a].min()) <= 0)
    heaviest = float(np.linalg.norm(loads[:, :3], axis=1).max())
    calibration = ForceCalibration(matrix, offset, scale)
    return Solved(
        calibration,
        matrix_sd,
        offset_sd,
        left,
        len(raw),
        tuple(sorted(left_out)),
        one_sided,
        heaviest,
        turn,
    )


def _describe_rows(rows: Sequence[int], names: Sequence[str]) -> str:
    return " and ".join(names[row] if names else f"load {1 + row}" for row in rows)


def is_stuck(values: Array) -> Bools:
    """Readings (n,) of axes (n, a) N with an axis at the end of its range several times in a row: clipped by a limit that is not declared.

    Not where a sensor repeats itself anyhow (coarse counts, no noise), and not near its level at rest.
    """
    found = np.zeros(len(values), bool)
    for axis in values.T:
        known = axis[np.isfinite(axis)]
        if len(known) < 8 or (np.diff(known) == 0).mean() > REPEATED:
            continue
        between = (known > known.min()) & (known < known.max())
        longest = max(
            STUCK, 1 + _longest_repeat_by_chance((np.diff(known) == 0) & between[1:], between[1:])
        )
        for end in (known.min(), known.max()):
            if abs(end - np.median(known)) > FAR:
                for first, stop in find_runs(axis == end):
                    found[first:stop] |= stop - first >= longest
    return found


def is_repeated(values: Array) -> Bools:
    """Readings (n,) of axes (n, a) N that repeat the one before in every axis more often in a row than luck makes them: no new ones.

    Not of a sensor whose counts are so coarse that axes stay as they are or readings come back while others change.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    again = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])
    found, fresh = np.zeros(len(values), bool), values[~again]
    if (
        len(fresh) < 8
        or (np.diff(fresh, axis=0) == 0).mean() > COARSE
        or len(np.unique(fresh, axis=0)) < (1 - COARSE) * len(fresh)
    ):
        return found
    stretches = find_runs(again)
    first = np.zeros(len(values), bool)
    first[[a for a, _ in stretches]] = True
    longest = max(STUCK, 1 + _longest_repeat_by_chance(first, ~again | first))
    for a, stop in stretches:
        found[a:stop] = stop - a >= longest
    return found


def _longest_repeat_by_chance(again: Bools, among: Bools) -> int:
    """How often in a row readings repeat themselves by luck, once in a recording of a hundred, where among so many so many do."""
    share, n = float(again.sum() / max(among.sum(), 1)), len(again)
    return (
        int(np.ceil(np.log(LUCK / max(n, 1)) / np.log(share)))
        if 0 < share < 1
        else n
        if share
        else 0
    )


def _design(loads: Array) -> Array:
    return np.column_stack([loads, np.ones(len(loads))])


def _require(raw: Array, loads: Array) -> None:
    """InputError where there are too few loads, they leave a direction out, or nobody reads them."""
    m = loads.shape[1]
    if len(raw) < m + 1 + SPARE:
        raise InputError("force.too_few_loads", raw=len(raw), m=m + 1 + SPARE)
    if raw.shape[1] < m:
        raise InputError("force.too_few_channels", shape=raw.shape[1], m=m)
    size = np.abs(loads).max(axis=0)
    missing = [AXES[a] for a in np.flatnonzero(size == 0)]
    spread = np.linalg.svd(_design(loads / np.where(size > 0, size, 1.0)))
    if not missing and spread.S[-1] * CONDITION < spread.S[0]:
        missing = [
            name for name, part in zip((*AXES[:m], NOTHING), spread.Vh[-1]) if abs(part) > 0.3
        ]
    if missing:
        how = "each by itself" if len(missing) > 1 else "both ways"
        raise InputError("force.loads_not_in_all_directions", missing=", ".join(missing), how=how)
    answer, *_ = np.linalg.lstsq(_design(loads), raw, rcond=None)
    parts = np.linalg.svd(answer[:m] * size[:, None], compute_uv=False)
    if parts[-1] * 1e4 < parts[0] or parts[0] == 0:
        raise InputError("force.readings_hardly_change")


def _outlying_rows(chance: float, raw: Array, loads: Array) -> NDArray[np.int_]:
    """The rows without which each channel's sum of squares falls by more than luck explains, the strangest first; of several each alone would do it.

    Of two rows with loads that are much alike one that is wrong draws the other's residual along. That goes as soon as the strangest one is away: a row
    without which more is left than luck makes of what is left without the strangest is not the wrong one.
    """
    from scipy import stats  # takes as long to import as all else that a method needs

    design = _design(loads)
    n, p = design.shape
    if n - 1 - p < SPARE:
        return np.empty(0, int)
    answer, *_ = np.linalg.lstsq(design, raw, rcond=None)
    squares = (raw - design @ answer) ** 2
    if (squares.sum(axis=0) < 1e-18 * (raw**2).sum(axis=0)).any():
        return np.empty(0, int)  # exact but for rounding
    q, _ = np.linalg.qr(design)
    falls = squares / np.maximum(1 - (q**2).sum(axis=1), 1e-9)[:, None]
    rest = np.maximum(squares.sum(axis=0) - falls, 1e-12 * squares.sum(axis=0))
    each = stats.f.logsf(falls / rest * (n - 1 - p), 1, n - 1 - p)
    # Fisher's: the channels' noise is taken to be independent
    luck = n * stats.chi2.sf(-2 * each.sum(axis=1), 2 * raw.shape[1])
    order = np.argsort(luck)
    strange = order[luck[order] < chance]
    more = stats.f.logsf(rest[strange] / rest[order[0]], n - 1 - p, n - 1 - p)
    is_equally_likely = n * stats.chi2.sf(-2 * more.sum(axis=1), 2 * raw.shape[1]) >= chance
    return np.asarray(strange[is_equally_likely])


def _scale_sd(loads: Array, left: Array, unknown: Array) -> float:
    """Share by which a force may be wrong where the loads are right: the fit's at such loads, and what it leaves of the forces."""
    size = float(np.sqrt((loads[:, :3] ** 2).sum(axis=1).mean()))
    noise = float(np.sqrt((left[:3] ** 2).sum()))
    of_fit = float(np.sqrt(np.einsum("ni,ij,nj->n", loads, unknown, loads).mean()))
    return float(np.hypot(noise * of_fit / size, noise / size))


def _turn_by_bias(loads: Array, level: float) -> float:
    """By how much, rad about each axis, an accelerometer's bias that tilts directions by `level` turns all loads together: opposite ones cancel it."""
    force = loads[:, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    along = force / np.where(size > 0, size, 1.0)
    turns = []
    for axis in np.eye(3):
        missed = level * (size * axis - force * (along @ axis)[:, None])
        E = np.linalg.lstsq(_design(loads), missed, rcond=None)[0][:3].T
        turns.append(0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]]))
    return float(np.sqrt((np.array(turns) ** 2).sum() / 3))
