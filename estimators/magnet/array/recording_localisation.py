"""Localisation throughout a recording of an array: corrections, and tests of what contradicts one
magnet in a homogeneous field.

In      Search: calibrated readings with times (search.py); the moment's size, if it is declared
Out     LocalisationResult: positions without those that are not to be trusted, and why; the noise
        from residuals
Source  localisation.py, second_magnet_test.py, field_gradient_test.py, timestamp_offsets.py,
        systematic_errors.py
Limits  eight magnetometers or more separate a second magnet or iron from noise; fewer only where it
        leaves more than noise
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from handscope.estimators.magnet.array import (
    field_gradient_test,
    second_magnet_test,
    systematic_errors,
    timestamp_offsets,
)
from handscope.estimators.magnet.array import localisation as magnet_localisation
from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
)
from handscope.estimators.magnet.array.localisation import Localisation
from handscope.estimators.magnet.array.search import UNKNOWNS, Search, build_problem, misfit_limit
from handscope.estimators.magnet.array.systematic_errors import SystematicErrors
from handscope.estimators.magnet.array.timestamp_offsets import TimestampOffsets
from handscope.estimators.numerics.typing import Array, Bools, Indices

MAX_ROUNDS = 8  # rounds of timestamp correction
# readings for systematic errors, at least and at most; readings corrected at once
MIN_READINGS, MAX_READINGS, CHUNK = 10, 200, 256
NOISE_READINGS, MIN_SPARE_AXES = 60, 9  # readings, and degrees of freedom at least, for the noise
MOVEMENT_SHARE = 0.5  # of the noise from differences: residuals below that show movement
CLOSE_TIME, CLOSE_SHARE = 0.5, 0.3  # s, share: disturbances that close by affect a reading
WIDE_TIME, WIDE_SHARE = 5.0, 0.5  # s, share: among so many, agreement is chance
# s between readings tested for a second magnet; below it is no noise
TEST_INTERVAL, MAX_P_VALUE = 0.1, 1e-4


@dataclass(frozen=True)
class LocalisationResult:
    """Places throughout a recording, with every test of one magnet."""

    search: Search  # with the noise from residuals
    localisation: Localisation
    is_inconsistent: Bools  # (n,) residuals of one magnet are too large around
    has_second_magnet: Bools  # (n,) a second magnet explains much around
    timestamp_offsets: TimestampOffsets  # that were corrected
    systematic: SystematicErrors | None = None  # common to all readings, where corrected


def locate_recording(
    search: Search, size: float | None, size_sd: float, least: float
) -> LocalisationResult:
    """`size` of the moment, A m^2, its standard deviation as a share; `least` T: residuals of
    calibrations."""
    search = _with_estimated_noise(
        search.with_offsets(np.zeros(len(search.array))), size, size_sd, least
    )
    search, localisation, offsets = _correct_timestamps(
        search, search.locate(size, size_sd), size, size_sd
    )
    search, localisation = _with_gradients(search, localisation, size, size_sd)
    localisation = _inflate_by_residuals(search, localisation, size)
    sampled_rows, p_value = (
        _sample_rows(search.t),
        _second_magnet_p_values(search, localisation, size, size_sd),
    )
    is_misfit = localisation.misfit > misfit_limit(
        np.isfinite(search.mag).all(axis=2).sum(axis=1), search.gradient_sd
    )
    is_better = p_value < MAX_P_VALUE
    is_inconsistent, has_second_magnet = (
        _is_frequent_around(search.t, localisation.misfit, is_misfit, CLOSE_TIME, CLOSE_SHARE),
        _is_frequent_around(search.t, p_value, is_better, CLOSE_TIME, CLOSE_SHARE),
    )
    sampled = np.full(len(search.t), np.nan)
    sampled[sampled_rows] = localisation.misfit[sampled_rows]
    is_chaotic = _is_frequent_around(
        search.t, sampled, np.isfinite(sampled) & (is_misfit | is_better), WIDE_TIME, WIDE_SHARE
    )
    is_inconsistent |= is_chaotic & ~has_second_magnet
    is_explained = (
        np.isfinite(localisation.misfit) & ~is_misfit & ~is_inconsistent & ~has_second_magnet
    )
    localisation, systematic = _remove_systematic_errors(
        search,
        replace(
            localisation, is_located=localisation.is_located & ~is_inconsistent & ~has_second_magnet
        ),
        is_explained,
        size,
        size_sd,
    )
    return LocalisationResult(
        search,
        _add_timing_uncertainty(search, localisation, offsets),
        is_inconsistent,
        has_second_magnet,
        offsets,
        systematic,
    )


def _with_estimated_noise(
    search: Search, size: float | None, size_sd: float, least: float
) -> Search:
    """With the noise from residuals, where differences between readings show movement."""
    rows, chips = max(search.group_by_available(), key=lambda group: len(group[0]))
    if (
        search.noise * MOVEMENT_SHARE < least
        or len(rows) * (3 * len(chips) - UNKNOWNS) < MIN_SPARE_AXES
    ):
        return search
    sample = search.select(rows[:: -(-len(rows) // NOISE_READINGS)]).of_magnetometers(chips)
    residual_noise = magnet_localisation.estimate_noise(sample.locate(size, size_sd), len(chips))
    return (
        replace(search, noise=max(residual_noise, least))
        if residual_noise < MOVEMENT_SHARE * search.noise
        else search
    )


def _correct_timestamps(
    search: Search, localisation: Localisation, size: float | None, size_sd: float
) -> tuple[Search, Localisation, TimestampOffsets]:
    """With magnetometers of significant timestamp offsets corrected, and the offsets, 0 where not
    significant."""
    total, sd = np.zeros((2, len(search.array)))
    part, places, selected = search, localisation, np.arange(len(search.t))
    for _ in range(MAX_ROUNDS):
        rows, chips = _most_complete_rows(part, places)
        if len(rows) < MIN_READINGS or 3 * len(chips) <= UNKNOWNS:
            break
        rows = rows[:: -(-len(rows) // MAX_READINGS)]
        systematic = systematic_errors.estimate_systematic_errors(
            *build_problem(part.of_magnetometers(chips), places, size, size_sd, rows)
        )
        offsets = timestamp_offsets.estimate_timestamp_offsets(systematic, len(chips))
        if systematic.p_value > MAX_P_VALUE or not offsets.is_significant.any():
            break
        total[chips] += np.where(offsets.is_significant, offsets.offsets, 0.0)
        sd[chips], selected = offsets.sd, selected[rows]
        part = search.with_offsets(total).select(selected)
        places = part.locate(size, size_sd)
    else:
        total[:] = 0.0  # what does not converge is no offset
    total = np.where(np.abs(total) < timestamp_offsets.MIN_CORRECTION, 0.0, total)
    before, now = np.nanmedian(localisation.misfit[selected]), np.nanmedian(places.misfit)
    if not total.any() or now > min(before, float(misfit_limit(len(search.array)))):
        return search, localisation, TimestampOffsets(np.zeros_like(total), sd)
    search = search.with_offsets(total)
    return search, search.locate(size, size_sd), TimestampOffsets(total, sd)


def _add_timing_uncertainty(
    search: Search, localisation: Localisation, offsets: TimestampOffsets
) -> Localisation:
    """Where many magnetometers have offsets, the time of a position is as uncertain as they
    differ."""
    by_place, by_moment = (
        timestamp_offsets.change_rates(search.t, v[:, None])[:, 0]
        for v in (localisation.place, localisation.moment)
    )
    place_sd, moment_sd = (
        np.hypot(localisation.place_sd, offsets.spread * by_place),
        np.hypot(localisation.moment_sd, offsets.spread * by_moment),
    )
    return _with_sds(search, localisation, place_sd, moment_sd)


def _with_gradients(
    search: Search, localisation: Localisation, size: float | None, size_sd: float
) -> tuple[Search, Localisation]:
    """With gradients of the field as unknowns where the test shows them, unless a second magnet
    explains most readings better."""
    rows, chips = _most_complete_rows(search, localisation)
    if not len(rows):
        return search, localisation
    problem, x = build_problem(
        search.of_magnetometers(chips),
        localisation,
        size,
        size_sd,
        rows[:: -(-len(rows) // NOISE_READINGS)],
    )
    test = field_gradient_test.gradient_f_test(problem, x)
    if test.p_value > field_gradient_test.MAX_P_VALUE or test.gradient_sd <= search.gradient_sd:
        return search, localisation
    with_gradients = replace(search, gradient_sd=test.gradient_sd)
    places = with_gradients.locate(size, size_sd)
    p_value = _second_magnet_p_values(with_gradients, places, size, size_sd)
    sampled = p_value[np.isfinite(p_value)]
    return (
        (search, localisation)
        if len(sampled) and np.median(sampled) < field_gradient_test.MAX_P_VALUE
        else (with_gradients, places)
    )


def _inflate_by_residuals(
    search: Search, localisation: Localisation, size: float | None
) -> Localisation:
    """Standard deviations no smaller than the residuals of all located readings allow: errors of
    calibrations and positions are common to them."""
    axes = 3.0 * np.isfinite(search.mag).all(axis=2).sum(axis=1)[localisation.is_located]
    spare = axes - UNKNOWNS - GRADIENT_TERMS * (search.gradient_sd > 0) + (size is not None)
    if not spare.sum() > 0:
        return localisation
    residual = float(
        np.sqrt((localisation.misfit[localisation.is_located] ** 2 * axes).sum() / spare.sum())
    )
    # a larger residual is counted already
    scale = np.maximum(1.0, residual / np.maximum(1.0, localisation.misfit))[:, None]
    return _with_sds(
        search, localisation, scale * localisation.place_sd, scale * localisation.moment_sd
    )


def _remove_systematic_errors(
    search: Search,
    localisation: Localisation,
    is_known: Bools,
    size: float | None,
    size_sd: float,
) -> tuple[Localisation, SystematicErrors | None]:
    """Correct known readings for systematic errors, with the uncertainty that remains."""
    rows, calibrated = max(
        ((rows[is_known[rows]], chips) for rows, chips in search.group_by_available()),
        key=lambda group: len(group[0]),
    )
    if 3 * len(calibrated) + (size is not None) <= UNKNOWNS or len(rows) < MIN_READINGS:
        return localisation, None
    systematic = systematic_errors.estimate_systematic_errors(
        *build_problem(
            search.of_magnetometers(calibrated),
            localisation,
            size,
            size_sd,
            rows[:: -(-len(rows) // MAX_READINGS)],
        )
    )
    if systematic.p_value > MAX_P_VALUE:
        return localisation, None
    x = np.concatenate([localisation.place, localisation.moment, localisation.field], axis=1)
    sd = np.concatenate([localisation.place_sd, localisation.moment_sd], axis=1)
    for among, chips in search.group_by_available():
        rows = among[is_known[among] & np.isin(chips, calibrated).all()]
        for part in np.array_split(rows, -(-len(rows) // CHUNK)) if len(rows) else ():
            problem, x_part = build_problem(
                search.of_magnetometers(chips), localisation, size, size_sd, part
            )
            shift, variance = systematic_errors.propagate_systematic_errors(
                problem, x_part, systematic, np.searchsorted(calibrated, chips), len(calibrated)
            )
            near = np.linalg.norm(x_part[:, None, :3] - problem.places, axis=-1).min(axis=1)
            # second-order error of the correction
            curvature = (shift[:, :3] ** 2).sum(axis=1) / near
            x[part], sd[part] = (
                x_part - shift,
                np.sqrt(variance[:, :6] + np.outer(curvature**2, np.repeat([1.0, 0.0], 3))),
            )
    corrected = replace(localisation, place=x[:, :3], moment=x[:, 3:6], field=x[:, 6:])
    return _with_sds(search, corrected, sd[:, :3], sd[:, 3:]), systematic


def _with_sds(
    search: Search, localisation: Localisation, place_sd: Array, moment_sd: Array
) -> Localisation:
    is_certain = place_sd.max(axis=1) < magnet_localisation.max_position_sd(
        localisation.place, search.array
    )
    return replace(
        localisation,
        place_sd=place_sd,
        moment_sd=moment_sd,
        is_located=localisation.is_located & is_certain,
    )


def _most_complete_rows(search: Search, localisation: Localisation) -> tuple[Indices, Indices]:
    """Located rows with the most frequent set of magnetometers, and that set."""
    rows, chips = max(search.group_by_available(), key=lambda group: len(group[0]))
    return rows[np.isfinite(localisation.misfit[rows])], chips


def _sample_rows(t: Array) -> Indices:
    """Readings to test for a second magnet: no more than needed."""
    return np.unique(
        np.searchsorted(t, np.arange(t[0], t[-1] + TEST_INTERVAL, TEST_INTERVAL)).clip(
            0, len(t) - 1
        )
    )


def _second_magnet_p_values(
    search: Search, localisation: Localisation, size: float | None, size_sd: float
) -> Array:
    """p values (n,) of one magnet against two; NaN where not tested."""
    p_value, some = np.full(len(search.t), np.nan), _sample_rows(search.t)
    for among, chips in search.select(some).group_by_available():
        rows = some[among]
        part = Localisation(
            **{
                field.name: getattr(localisation, field.name)[rows]
                for field in fields(Localisation)
            }
        )
        group = search.select(rows).of_magnetometers(chips)
        p_value[rows] = second_magnet_test.second_magnet_f_test(
            group.mag,
            group.array,
            part,
            search.noise,
            search.place_sd,
            size,
            size_sd,
            search.gradient_sd,
        ).p_value
    return p_value


def _is_frequent_around(
    t: Array, known: Array, is_flagged: Bools, near: float, share: float
) -> Bools:
    """Readings (n,) with more than `share` flagged of the known ones (no NaN) within `near` s."""
    counted = np.concatenate([[0], np.cumsum(np.isfinite(known))])
    flagged = np.concatenate([[0], np.cumsum(is_flagged)])
    first, last = np.searchsorted(t, t - near), np.searchsorted(t, t + near, side="right")
    return np.asarray(flagged[last] - flagged[first] > share * (counted[last] - counted[first]))
