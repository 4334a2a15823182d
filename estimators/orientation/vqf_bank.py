"""The filter of a sensor's orientation as the library has it, its options, and the filters of many
sensors that go on together.

In      rates, rad/s, and specific forces, m/s^2, in the sensors' frames
Out     q_GS: takes vectors from the sensor to the global frame (z up)
Source  VQF: Laidig & Seel 2023, Information Fusion 91:187 (package vqf)
Limits  a state remembers some blocks: to read a filter costs ten times its step, so that not every
        filter is read behind every sample
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from vqf import VQF

from handscope.estimators.data.options import option
from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True, kw_only=True)
class FusionParams:
    """Options of the fusion of a sensor's orientation."""

    tau_acc: float = option(
        3.0,
        "s",
        "time constant of the accelerometer's correction: larger trusts the gyroscope longer",
        "VQF default (Laidig & Seel 2023)",
        least=0.01,
    )
    rest_bias: bool = option(
        True,
        "",
        "estimate the gyroscope's bias whenever the sensor rests",
        "VQF default (Laidig & Seel 2023)",
    )
    motion_bias: bool = option(
        True,
        "",
        "estimate the gyroscope's bias during movement",
        "VQF default (Laidig & Seel 2023)",
    )
    rest_gyr: float = option(
        2.0,
        "deg/s",
        "largest deviation of the angular rate that counts as rest",
        "VQF default (Laidig & Seel 2023)",
        least=0.01,
    )
    rest_turn: float = option(
        0.1,
        "deg/s",
        "rate at which a sensor that seems to rest still turns (standard deviation): a bias found at rest is no better known",
        "ours: skin under a still hand's sensor turns while fingers move; VQF's 0.03 is for sensors laid down (docs/validation/drift.md)",
        least=0.001,
    )
    rest_acc: float = option(
        0.5,
        "m/s^2",
        "largest deviation of the acceleration that counts as rest",
        "VQF default (Laidig & Seel 2023)",
        least=0.01,
    )
    tau_mag: float = option(
        9.0,
        "s",
        "time constant of the magnetometer's correction of the heading",
        "VQF default (Laidig & Seel 2023)",
        least=0.01,
    )
    gyr_reading: str = option(
        "mean",
        "",
        "what a gyroscope's sample is: the mean rate since the one before, as filtered sensors give it, or the rate at its instant",
        "ours: on ten real trials (BROAD) inclination 0.76 deg with mean, 0.94 deg with instant",
        ("mean", "instant"),
    )
    mag_rejection: bool = option(
        True,
        "",
        "leave the magnetometer out while its field differs in strength or dip from the one learnt",
        "VQF default (Laidig & Seel 2023); the paper's filter has none",
    )
    max_gap: float = option(
        0.25,
        "s",
        "longest stretch of missing samples that is bridged by interpolation",
        "ours: docs/methods/m2.md, lost samples",
        most=1.0,
    )


def start_filter(params: FusionParams, period: float) -> VQF:
    """The library's filter before its first sample; samples come every `period` s."""
    return VQF(
        period,
        tauAcc=params.tau_acc,
        motionBiasEstEnabled=params.motion_bias,
        restBiasEstEnabled=params.rest_bias,
        restThGyr=params.rest_gyr,
        biasSigmaRest=params.rest_turn,
        restThAcc=params.rest_acc,
        tauMag=params.tau_mag,
        magDistRejectionEnabled=params.mag_rejection,
    )


def update_filter(vqf: VQF, gyr: Array, acc: Array) -> Array:
    """Orientations (n, 4) by gyroscope and accelerometer, (n, 3) each; the library's call for many
    samples costs a single one three times as much."""
    if len(gyr) == 1:
        vqf.update(gyr[0], acc[0])
        return np.asarray(vqf.getQuat6D())[None]
    return np.asarray(vqf.updateBatch(gyr, acc)["quat6D"])


@dataclass(frozen=True)
class FilterCache:
    """What a filter knew behind a block."""

    state: Mapping[str, Any]
    count: int  # blocks gone through until then


@dataclass(frozen=True)
class FilterBank:
    """Filters of sensors that go on together: each as it was some blocks ago, and the blocks since.

    `standing` holds at most one set of the library's own filters, which stand behind the newest
    block: whoever goes on first takes them, anyone later makes others and goes through the blocks
    since again, to the same bits. It is not saved.
    """

    params: FusionParams
    period: float  # s
    caches: tuple[FilterCache, ...]
    # rates and specific forces (sensors, n, 3) of the newest blocks
    since: tuple[tuple[Array, Array], ...] = ()
    count: int = 0
    standing: list[list[VQF]] = field(default_factory=list, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "standing": []}

    def states(self) -> tuple[Mapping[str, Any], ...]:
        """The state of each filter."""
        filters = self._again()
        return tuple(
            f.state if caches.count < self.count else caches.state
            for f, caches in zip(filters, self.caches)
        )

    def advance(self, gyr: Array, acc: Array) -> tuple["FilterBank", Array]:
        """Behind one more block, (sensors, n, 3) each, and the orientations (n, sensors, 4) at its
        samples."""
        try:
            filters = self.standing.pop()
        except IndexError:
            filters = self._again()
        q_GS, count, caches = (
            np.empty((gyr.shape[1], len(gyr), 4)),
            self.count + 1,
            list(self.caches),
        )
        for k, one in enumerate(filters):
            q_GS[:, k] = update_filter(one, gyr[k], acc[k])
        for k in self._read_next(gyr.shape[1]):
            caches[k] = FilterCache(filters[k].state, count)
        remembered = count - min(k.count for k in caches)
        since = (*self.since, (gyr, acc))[len(self.since) + 1 - remembered :]
        return FilterBank(self.params, self.period, tuple(caches), since, count, [filters]), q_GS

    def _read_next(self, samples: int) -> Sequence[int]:
        """The sensors whose filters are read behind a block: one a sample, in turn."""
        sensors = len(self.caches)
        if samples >= sensors:
            return range(sensors)
        return sorted(range(sensors), key=lambda k: self.caches[k].count)[:samples]

    def _again(self) -> list[VQF]:
        """Other filters that stand behind the newest block."""
        filters = []
        for k, caches in enumerate(self.caches):
            one = start_filter(self.params, self.period)
            one.state = caches.state
            for gyr, acc in self.since[len(self.since) - (self.count - caches.count) :]:
                update_filter(one, gyr[k], acc[k])
            filters.append(one)
        return filters
