"""Which faults the movement of a recording could not have shown: where nothing is found, and nothing could be.

In      samples, what is declared of them, calibrations
Out     gyroscopes that nothing compares with anything, and strips whose delay nothing would show
Source  a gain of `GAIN`, or a delay of `LATE`, put into the sensor has to leave as many odd windows as the checks ask for before they look closer
Limits  says what a fault of that size would have shown; smaller ones need more movement
"""

from collections.abc import Collection, Sequence

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.fault_detection.finding import Untested
from handscope.estimators.fault_detection.neighbours import paired_test
from handscope.estimators.fault_detection.neighbours.check_neighbours import prepare_pairs
from handscope.estimators.fault_detection.neighbours.rates import synchrony
from handscope.estimators.fault_detection.neighbours.rates.common_rates import CommonRates
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.fault_detection.single_sensors.cells import begins, cells_of
from handscope.estimators.fault_detection.single_sensors.common_fault import FINE
from handscope.estimators.fault_detection.single_sensors.gravity_fit import (
    likelihoods_of,
)
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics.typing import Array

GAIN, LATE = 1.3, 0.2  # s


def untested(
    blocks: Sequence[Block],
    declared: Recording,
    calibrations: Sequence[Calibration] = (),
    named: Collection[str] = (),
) -> Untested:
    """Gyroscopes and strips of which the movement tells nothing.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of all streams.
    declared : Recording
        Hand, geometry and mounting.
    calibrations : sequence of Calibration
        How sensors are turned against their segments, where it is known.
    named : collection of str
        Sensors of which something is found: they are left out.
    """
    by_gravity = _shown_by_gravity(blocks)
    pairs = prepare_pairs(blocks, declared.geometry, declared.mounting, calibrations)
    rates = None if pairs is None else CommonRates(pairs)
    sensors = [
        s for s in by_gravity if s not in named and not by_gravity[s] and not _gain_shows(rates, s)
    ]
    strips = [
        finger
        for finger, chain in CHAINS.items()
        if set(chain) <= set(by_gravity) and not set(chain) & set(named)
    ]
    together = set() if pairs is None else set(synchrony.comparable_fingers(pairs))
    return Untested(
        tuple(sensors),
        tuple(f for f in strips if f not in together and not _delay_shows(rates, f)),
    )


def _shown_by_gravity(blocks: Sequence[Block]) -> dict[str, bool]:
    """By sensor of inertial streams: whether its accelerometer's readings are explained much better with its gyroscope than without."""
    cells = cells_of([b for b in whole_streams(blocks) if (np.diff(b.t) > 0).all()])
    if not len(begins(len(cells.valid))):
        return dict.fromkeys(cells.sensors, False)
    as_it_is, too_much = likelihoods_of(cells, np.array([np.eye(3), GAIN * np.eye(3)]))
    gained = (as_it_is - too_much).sum(axis=0)
    return {s: bool(g > FINE) for s, g in zip(cells.sensors, gained)}


def _gain_shows(rates: CommonRates | None, sensor: str) -> bool:
    if rates is None or sensor not in rates.pairs.series.sensors:  # the trunk's has no neighbour
        return False
    hinges = [j for j in rates.hinges if sensor in j and rates.explains]
    gains = [(1.0 if j[1] == sensor else GAIN, GAIN if j[1] == sensor else 1.0) for j in hinges]
    if any(_differs(rates.left(j), rates.left(j, 0.0, *g)) for j, g in zip(hinges, gains)):
        return True
    wrong = rates.pairs.with_gain(sensor, GAIN)
    return any(wrong.is_doubtful(*j) for j in rates.pairs.joints if sensor in j)


def _delay_shows(rates: CommonRates | None, finger: str) -> bool:
    if rates is None:
        return False
    roots = [j for j in rates.pairs.joints if j[0] == "hand" and j[1] == CHAINS[finger][0]]
    by_rates = [j for j in roots if j in rates.joints and rates.explains]
    if any(_differs(rates.left(j), rates.left(j, LATE)) for j in by_rates):
        return True
    return any(_acceleration_shows(rates.pairs, *j) for j in roots)


def _acceleration_shows(pairs: Pairs, a: str, b: str) -> bool:
    as_it_is, late = pairs.joint(a, b, (a, b)), pairs.joint(a, b, (a, b), LATE)
    use = pairs.use(a, b) & pairs.use(a, b, LATE) & pairs.moves(a) & pairs.moves(b)
    return _differs((as_it_is.rest / late.noise)[use], (late.rest / late.noise)[use])


def _differs(without: Array, wrong: Array) -> bool:
    """Whether as many windows as a test needs leave twice as much with the fault, noise counted in."""
    return bool(np.count_nonzero(wrong + 1.0 > 2.0 * (without + 1.0)) >= paired_test.FEWEST)
