"""Where a magnet is throughout a recording of an array: place by place, and what beside or around them contradicts one magnet in a homogeneous field.

In      readings (n, magnetometers, 3), T, with their times; where the magnetometers sit; their noise as differences of readings tell it
Out     Searched: Located with what is not to be trusted taken out, and why; the noise as places tell it
Source  magnet_localisation.py, magnet_second.py, magnet_uneven.py, magnet_late.py, magnet_alike.py
Limits  a second magnet or iron is told from noise by eight magnetometers or more; fewer see it where it leaves more than noise
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
from handscope.estimators.magnet.array.dipole_fit import SLOPES, Told, by_places
from handscope.estimators.magnet.array.localisation import Located
from handscope.estimators.magnet.array.systematic_errors import Alike
from handscope.estimators.magnet.array.timestamp_offsets import Late
from handscope.estimators.magnet.model.setup import Constellation
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools, Indices

AGAIN = 8  # rounds in which readings that are late are moved
FEWEST, TAUGHT, TAKEN = (
    10,
    200,
    256,
)  # readings that tell what errs alike, at least and at most; from which it is taken off at once
SAMPLED, SPARE = (
    60,
    9,
)  # readings, and axes above the unknowns in all of them, of which the noise is asked
LESS = 0.5  # of the noise that differences tell: so much less that they tell of movement
CLOSE, MANY = 0.5, 0.3  # s, share of the readings that close by: what disturbs those draws these
WIDE, MOST = 5.0, 0.5  # s, share of the readings around: then what agrees does so by chance
LOOKED, CHANCE = (
    0.1,
    1e-4,
)  # s between readings that are looked at for a second magnet; probability below which noise is none
UNKNOWNS = 9  # place, moment, field
WORST = 1.7  # standard deviations a degree of freedom; what is counted for calibration and places is rather too much
FEW, MANY_REGIONS = (
    9,
    3,
)  # so few magnetometers are explained by several places; with more the octants' best ones lead to the same


@dataclass(frozen=True)
class Search:
    """Calibrated readings and where they were taken."""

    t: Array  # (n,) s
    mag: Array  # (n, magnetometers, 3) T
    array: Constellation
    noise: float  # T
    place_sd: float  # m
    uneven: float = 0.0  # T/m, of each slope of the field
    rate: Array | None = None  # (n, magnetometers, 3) T/s by which readings change

    def of(self, rows: Indices) -> "Search":
        return replace(
            self,
            t=self.t[rows],
            mag=self.mag[rows],
            rate=None if self.rate is None else self.rate[rows],
        )

    def by(self, chips: Indices) -> "Search":
        array = Constellation(self.array.places[chips], self.array.q_bl[chips])
        return replace(
            self,
            mag=self.mag[:, chips],
            array=array,
            rate=None if self.rate is None else self.rate[:, chips],
        )

    def moved(self, late: Array) -> "Search":
        """With magnetometers that are late by so many s (magnetometers,) moved to when their readings were taken."""
        mag = timestamp_offsets.moved(self.t, self.mag, late)
        return replace(self, mag=mag, rate=timestamp_offsets.rates(self.t, mag))

    def answering(self) -> list[tuple[Indices, Indices]]:
        """Rows with the same magnetometers answering, and which."""
        kinds, kind = np.unique(np.isfinite(self.mag).all(axis=2), axis=0, return_inverse=True)
        return [
            (np.flatnonzero(kind.ravel() == k), np.flatnonzero(there))
            for k, there in enumerate(kinds)
        ]

    def located(self, size: float | None, size_sd: float) -> Located:
        """Places that agree with the size of the moment told, by the magnetometers that answer."""
        out = _nowhere(len(self.t))
        for rows, chips in self.answering():
            if len(chips) < len(self.array) and 3 * len(chips) + (size is not None) <= UNKNOWNS:
                continue
            found = self.of(rows).by(chips)._located(size, size_sd)
            for field in fields(Located):
                getattr(out, field.name)[rows] = getattr(found, field.name)
        return out

    def _located(self, size: float | None, size_sd: float) -> Located:
        regions = MANY_REGIONS if len(self.array) <= FEW else magnet_localisation.REGIONS
        worst = float(worst_misfit(len(self.array), self.uneven))
        told = {
            "size_sd": size_sd,
            "place_sd": self.place_sd,
            "worst": worst,
            "uneven": self.uneven,
        }
        found = magnet_localisation.located(
            self.mag, self.array, None, size, self.noise, regions=regions, **told
        )
        return replace(found, found=found.found & ~found.disputed)


@dataclass(frozen=True)
class Searched:
    search: Search  # with the noise as places tell it
    located: Located
    strange: Bools  # (n,) around these, one magnet leaves too much
    two: Bools  # (n,) around these, a second magnet explains much
    late: Late  # by which magnetometers were moved
    alike: Alike | None = None  # what errs alike in all readings, where it was taken off


def searched(search: Search, size: float | None, size_sd: float, least: float) -> Searched:
    """`size` of the moment, A m^2, and how well it is known, a share of it; `least` T is what calibrations leave."""
    search = _quieter(search.moved(np.zeros(len(search.array))), size, size_sd, least)
    search, located, late = _in_time(search, search.located(size, size_sd), size, size_sd)
    search, located = _with_slopes(search, located, size, size_sd)
    located = _left_counted(search, located, size)
    looked, chance = _looked(search.t), _chance(search, located, size, size_sd)
    too_much = located.misfit > worst_misfit(
        np.isfinite(search.mag).all(axis=2).sum(axis=1), search.uneven
    )
    better = chance < CHANCE
    strange, two = (
        _around(search.t, located.misfit, too_much, CLOSE, MANY),
        _around(search.t, chance, better, CLOSE, MANY),
    )
    seldom = np.full(len(search.t), np.nan)
    seldom[looked] = located.misfit[looked]
    chaos = _around(search.t, seldom, np.isfinite(seldom) & (too_much | better), WIDE, MOST)
    strange |= chaos & ~two
    explained_well = np.isfinite(located.misfit) & ~too_much & ~strange & ~two
    located, alike = _taken_off(
        search,
        replace(located, found=located.found & ~strange & ~two),
        explained_well,
        size,
        size_sd,
    )
    return Searched(search, _times_counted(search, located, late), strange, two, late, alike)


def worst_misfit(many: int | Indices, uneven: float = 0.0) -> Array:
    """What so many magnetometers may leave (RMS, standard deviations): nine unknowns explain a part of the errors, the more the fewer there are; slopes of the
    field, too."""
    axes = np.maximum(3.0 * np.asarray(many), 1.0)
    return np.asarray(
        WORST * np.sqrt(np.maximum(axes - UNKNOWNS - SLOPES * (uneven > 0), 1.0) / axes)
    )


def _nowhere(n: int) -> Located:
    place, moment, field, place_sd, moment_sd = np.full((5, n, 3), np.nan)
    left, misfit = np.full((2, n), np.nan)
    return Located(
        place,
        moment,
        field,
        place_sd,
        moment_sd,
        left,
        misfit,
        np.zeros(n, bool),
        np.zeros(n, bool),
    )


def _quieter(search: Search, size: float | None, size_sd: float, least: float) -> Search:
    """With the noise that places leave, where the magnet moves so much from one reading to the next that their differences tell of movement."""
    rows, chips = max(search.answering(), key=lambda alike: len(alike[0]))
    if search.noise * LESS < least or len(rows) * (3 * len(chips) - UNKNOWNS) < SPARE:
        return search
    sample = search.of(rows[:: -(-len(rows) // SAMPLED)]).by(chips)
    left = magnet_localisation.noise_left(sample.located(size, size_sd), len(chips))
    return replace(search, noise=max(left, least)) if left < LESS * search.noise else search


def explained(
    search: Search, located: Located, size: float | None, size_sd: float, rows: Indices
) -> tuple[Told, Array]:
    """Readings whose places are known, by the magnetometers that answer in all of them, and the unknowns (n, 9) that explain them."""
    x = np.concatenate([located.place, located.moment, located.field], axis=1)[rows]
    y, ones = (
        quat.rotate(search.array.q_bl, search.mag[rows]),
        np.ones((len(rows), len(search.array))),
    )
    told = Told(y, search.array.places, None, size, search.noise, size_sd, ones, search.uneven)
    told = (
        told
        if search.rate is None
        else replace(told, rate=quat.rotate(search.array.q_bl, search.rate[rows]))
    )
    return told.with_louder(by_places(x, told, search.place_sd)), x


def _in_time(
    search: Search, located: Located, size: float | None, size_sd: float
) -> tuple[Search, Located, Late]:
    """With magnetometers that are surely late against the others moved to when their readings were taken; by how much, 0 where it is not sure."""
    total, sd = np.zeros((2, len(search.array)))
    looked, places, kept = search, located, np.arange(len(search.t))
    for _ in range(AGAIN):
        rows, chips = _alike(looked, places)
        if len(rows) < FEWEST or 3 * len(chips) <= UNKNOWNS:
            break
        rows = rows[:: -(-len(rows) // TAUGHT)]
        alike = systematic_errors.learnt(*explained(looked.by(chips), places, size, size_sd, rows))
        found = timestamp_offsets.late(alike, len(chips))
        if alike.chance > CHANCE or not found.surely.any():
            break
        total[chips] += np.where(found.surely, found.late, 0.0)
        sd[chips], kept = found.sd, kept[rows]
        looked = search.moved(total).of(kept)
        places = looked.located(size, size_sd)
    else:
        total[:] = 0.0  # what comes to no end is no lateness
    total = np.where(np.abs(total) < timestamp_offsets.TOLD, 0.0, total)
    before, now = np.nanmedian(located.misfit[kept]), np.nanmedian(places.misfit)
    if not total.any() or now > min(before, float(worst_misfit(len(search.array)))):
        return search, located, Late(np.zeros_like(total), sd)
    search = search.moved(total)
    return search, search.located(size, size_sd), Late(total, sd)


def _times_counted(search: Search, located: Located, late: Late) -> Located:
    """Where many magnetometers are late, each by another time, the time of a place is as unsure as they differ."""
    by_place, by_moment = (
        timestamp_offsets.rates(search.t, v[:, None])[:, 0] for v in (located.place, located.moment)
    )
    place_sd, moment_sd = (
        np.hypot(located.place_sd, late.spread * by_place),
        np.hypot(located.moment_sd, late.spread * by_moment),
    )
    return _less_sure(search, located, place_sd, moment_sd)


def _with_slopes(
    search: Search, located: Located, size: float | None, size_sd: float
) -> tuple[Search, Located]:
    """With the field's slopes as unknowns where the readings show them; not where a second magnet explains most readings still better."""
    rows, chips = _alike(search, located)
    if not len(rows):
        return search, located
    told, x = explained(search.by(chips), located, size, size_sd, rows[:: -(-len(rows) // SAMPLED)])
    found = field_gradient_test.uneven(told, x)
    if found.chance > field_gradient_test.CHANCE or found.size <= search.uneven:
        return search, located
    allowed = replace(search, uneven=found.size)
    places = allowed.located(size, size_sd)
    chance = _chance(allowed, places, size, size_sd)
    known = chance[np.isfinite(chance)]
    return (
        (search, located)
        if len(known) and np.median(known) < field_gradient_test.CHANCE
        else (allowed, places)
    )


def _left_counted(search: Search, located: Located, size: float | None) -> Located:
    """Places no surer than what all that were found leave says: calibrations that have changed and magnetometers that sit elsewhere are in all readings alike."""
    axes = 3.0 * np.isfinite(search.mag).all(axis=2).sum(axis=1)[located.found]
    spare = axes - UNKNOWNS - SLOPES * (search.uneven > 0) + (size is not None)
    if not spare.sum() > 0:
        return located
    left = float(np.sqrt((located.misfit[located.found] ** 2 * axes).sum() / spare.sum()))
    grown = np.maximum(1.0, left / np.maximum(1.0, located.misfit))[
        :, None
    ]  # a reading that leaves more has that in its own
    return _less_sure(search, located, grown * located.place_sd, grown * located.moment_sd)


def _taken_off(
    search: Search, located: Located, known: Bools, size: float | None, size_sd: float
) -> tuple[Located, Alike | None]:
    """Places of the readings that are known without what errs alike in all of them, as far as they tell it, and as sure as that leaves them."""
    rows, taught = max(
        ((rows[known[rows]], chips) for rows, chips in search.answering()),
        key=lambda alike: len(alike[0]),
    )
    if 3 * len(taught) + (size is not None) <= UNKNOWNS or len(rows) < FEWEST:
        return located, None
    alike = systematic_errors.learnt(
        *explained(search.by(taught), located, size, size_sd, rows[:: -(-len(rows) // TAUGHT)])
    )
    if alike.chance > CHANCE:
        return located, None
    x = np.concatenate([located.place, located.moment, located.field], axis=1)
    sd = np.concatenate([located.place_sd, located.moment_sd], axis=1)
    for among, chips in search.answering():
        rows = among[known[among] & np.isin(chips, taught).all()]
        for part in np.array_split(rows, -(-len(rows) // TAKEN)) if len(rows) else ():
            told, found = explained(search.by(chips), located, size, size_sd, part)
            off, variance = systematic_errors.drawn(
                told, found, alike, np.searchsorted(taught, chips), len(taught)
            )
            near = np.linalg.norm(found[:, None, :3] - told.places, axis=-1).min(axis=1)
            bent = (off[:, :3] ** 2).sum(axis=1) / near  # what was taken off to first order
            x[part], sd[part] = (
                found - off,
                np.sqrt(variance[:, :6] + np.outer(bent**2, np.repeat([1.0, 0.0], 3))),
            )
    without = replace(located, place=x[:, :3], moment=x[:, 3:6], field=x[:, 6:])
    return _less_sure(search, without, sd[:, :3], sd[:, 3:]), alike


def _less_sure(search: Search, located: Located, place_sd: Array, moment_sd: Array) -> Located:
    sure = place_sd.max(axis=1) < magnet_localisation.surest(located.place, search.array)
    return replace(located, place_sd=place_sd, moment_sd=moment_sd, found=located.found & sure)


def _alike(search: Search, located: Located) -> tuple[Indices, Indices]:
    """Rows of places that the same magnetometers tell, as many as there are, and which those are."""
    rows, chips = max(search.answering(), key=lambda alike: len(alike[0]))
    return rows[np.isfinite(located.misfit[rows])], chips


def _looked(t: Array) -> Indices:
    """Readings of which a second magnet is asked: not more than are needed."""
    return np.unique(
        np.searchsorted(t, np.arange(t[0], t[-1] + LOOKED, LOOKED)).clip(0, len(t) - 1)
    )


def _chance(search: Search, located: Located, size: float | None, size_sd: float) -> Array:
    """That one magnet and noise explain readings (n,) so badly against two; NaN where that was not asked."""
    chance, some = np.full(len(search.t), np.nan), _looked(search.t)
    for among, chips in search.of(some).answering():
        rows = some[among]
        part = Located(
            **{field.name: getattr(located, field.name)[rows] for field in fields(Located)}
        )
        alike = search.of(rows).by(chips)
        chance[rows] = second_magnet_test.second(
            alike.mag,
            alike.array,
            part,
            search.noise,
            search.place_sd,
            size,
            size_sd,
            search.uneven,
        ).chance
    return chance


def _around(t: Array, known: Array, strange: Bools, near: float, share: float) -> Bools:
    """Readings (n,) with more than that share strange of those that are known, no NaN, within `near` s."""
    counted = np.concatenate([[0], np.cumsum(np.isfinite(known))])
    off = np.concatenate([[0], np.cumsum(strange)])
    first, last = np.searchsorted(t, t - near), np.searchsorted(t, t + near, side="right")
    return np.asarray(off[last] - off[first] > share * (counted[last] - counted[first]))
