"""What all gyroscopes of a recording have wrong together: a fault of the file, or accelerations of the arm, not of its sensors.

In      what is judged of every sensor; cells of readings
Out     the fault that most sensors share, the factor by which the file's rate is wrong, or each sensor's faults without what most of them show
Source  the null of a recording is that of most of its sensors: Efron 2004, J Am Stat Assoc 99:96
Limits  a rate told wrong and gyroscopes that all read too much by the same factor look the same
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.fault_detection.single_sensors.cells import Cells, begins
from handscope.estimators.fault_detection.single_sensors.gravity_fit import (
    fit,
    information_of,
    priors,
)
from handscope.estimators.fault_detection.single_sensors.gravity_windows import (
    MATRIX,
    windows_of,
)
from handscope.estimators.fault_detection.single_sensors.gyroscope_check import (
    GAIN,
    GAINED,
    IDENTITY,
    Judged,
)
from handscope.estimators.fault_detection.single_sensors.gyroscope_faults import Fault, share_of
from handscope.estimators.numerics.tail_probabilities import normal_sf

LEAST = 3  # sensors that share a fault of the file
AGREE = 2.0  # times as many as those that do not
FINE = 20.0  # log-likelihood that the gyroscope of a sensor without fault gains
CORRELATED = 4.0  # by how much more the mean of all sensors varies than if their errors had nothing in common: the arm moves them all
CLOCK = 0.01  # of a rate or of scales: what they may have in common
ROUNDS, SMALL = 4, 0.003
FEWEST = 6  # sensors that together show what moves them all
OTHERS = 2 / 3  # quantile of the other sensors' evidence that is counted as due to that


@dataclass(frozen=True)
class CommonRate:
    """By how much all gyroscopes turn too little or too much for the time that the file tells."""

    factor: float  # true rate of turning over the one read
    sd: float
    p_value: float
    agreeing: float  # share of the information in sensors that agree


def shared_fault(judged: Sequence[Judged], surely: Sequence[bool]) -> Fault | None:
    """The fault, not a gain, that most sensors share; `surely` says which have one."""
    sure = [j for j, is_sure in zip(judged, surely) if is_sure]
    fine = sum(not is_sure and j.useful > FINE for j, is_sure in zip(judged, surely))
    faults = {
        (f.code, f.values): f
        for j in sure
        for f in (v.fault for v in j.rivals)
        if f.code not in CONTINUOUS
    }
    sharing = {f: [j for j in sure if j.may_be(f)] for f in faults.values()}
    for fault, those in sorted(
        sharing.items(), key=lambda item: (-len(item[1]), -share_of(item[0].code))
    ):
        if len(those) >= LEAST and len(those) >= AGREE * (len(sure) - len(those) + fine):
            return fault
    return None


CONTINUOUS = ("gyroscope_gain", "gyroscope_axis_gain", "gyroscope_delay", "gyroscope_matrix")


def beyond_the_others(judged: Sequence[Judged]) -> list[Judged]:
    """The same with all evidence less what gains, matrices and delays have, beyond chance, in all but a third of the other sensors.

    An arm that accelerates as it turns looks like these in every sensor that it carries.
    """
    found = np.array([_continuous_evidence(j) for j in judged])
    if len(found) < FEWEST:
        return list(judged)
    others = [float(np.quantile(np.delete(found, k), OTHERS)) for k in range(len(found))]
    return [_less(j, max(0.0, each - GAINED)) for j, each in zip(judged, others)]


def _continuous_evidence(judged: Judged) -> float:
    return max((v.evidence for v in judged.verdicts if v.fault.code in CONTINUOUS), default=0.0)


def _less(judged: Judged, evidence: float) -> Judged:
    rest = (replace(v, evidence=v.evidence - evidence) for v in judged.verdicts)
    return replace(judged, verdicts=tuple(v for v in rest if v.evidence > 0))


def common_rate(cells: Cells, begin: float = 1.0) -> CommonRate | None:
    """The gain that all gyroscopes have in common.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors.
    begin : float
        Factor from which it is looked for.

    Returns
    -------
    CommonRate or None
        None where fewer than three sensors tell it.
    """
    factor = begin
    if not len(begins(len(cells.valid))):
        return None
    for _ in range(ROUNDS):
        found = fit(information_of(windows_of(cells, factor * IDENTITY)), priors(GAIN))
        along = GAIN[:, 0] / np.sqrt(3.0)  # mean of the diagonal
        change = found.x[:, MATRIX] @ along
        variance = np.einsum("i,sij,j->s", along, found.cov[:, MATRIX, MATRIX], along) + CLOCK**2
        weight = 1.0 / variance
        telling = weight > 1.0 / 0.1**2
        if telling.sum() < LEAST:
            return None
        mean = float((weight * change)[telling].sum() / weight[telling].sum())
        factor += mean
        if abs(mean) < SMALL:
            break
    sd = float(np.sqrt(CORRELATED / weight[telling].sum() + CLOCK**2))
    near = np.abs(change - mean) < 3.0 * np.sqrt(variance)
    agreeing = float((weight * (near & telling)).sum() / weight[telling].sum())
    return CommonRate(factor, sd, float(2 * normal_sf(abs(factor - 1.0) / sd)), agreeing)
