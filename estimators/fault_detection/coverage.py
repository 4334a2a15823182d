"""Which faults the movement of a recording could not have shown: where nothing is found, and nothing could be.

In      samples, what is declared of them, calibrations
Out     gyroscopes that nothing compares with anything, strips whose delay nothing would show, fingers that could be on each other's place, and sensors that could have turned on their segments
Source  every gain of `GAINS`, and delay of `LATE`, is put into the sensor: the tests of the checks have to find it, as sure as they have to be of a fault. So a sensor that has
        such a fault already does not count as tested: with the opposite one it reads what is right, and nothing is found
Limits  says what a fault of that size would have shown; smaller ones need more movement
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.fault_detection.finding import Untested
from handscope.estimators.fault_detection.neighbours import (
    delays,
    gains,
    joint_places,
    slips,
    unexplained,
    vibration,
)
from handscope.estimators.fault_detection.neighbours.check_neighbours import (
    FALSE_ALARM,
    Compared,
    Views,
)
from handscope.estimators.fault_detection.neighbours.rates import rate_tests, synchrony
from handscope.estimators.fault_detection.single_sensors import gyroscope_check, rest_turns
from handscope.estimators.fault_detection.single_sensors.cells import Cells, begins
from handscope.estimators.fault_detection.single_sensors.gravity_fit import information_of
from handscope.estimators.fault_detection.single_sensors.gravity_windows import windows_of
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat

GAINS, LATE = (1.3, 1 / 1.3), (0.2, -0.2)  # s
TURN = np.radians(17.0)  # about the axis of flexion
HALF = 0.5  # of a recording's windows in which a turn has to show


def untested(
    blocks: Sequence[Block],
    declared: Recording,
    calibrations: Sequence[Calibration] = (),
    named: Collection[str] = (),
    compared: Compared | None = None,
    by_gravity: Mapping[str, Mapping[float, bool]] | None = None,
) -> Untested:
    """Gyroscopes, strips, fingers and mountings of which the movement tells nothing.

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
    compared : Compared, optional
        Of the same recording, where other checks share it.
    by_gravity : mapping, optional
        `shown_by_gravity` of its cells, where that was asked for before.
    """
    compared = compared or Compared(blocks, declared, calibrations)
    by_gravity = by_gravity or shown_by_gravity(compared.cells)
    views = compared.views
    sensors = [
        s
        for s, shown in by_gravity.items()
        if s not in named and not all(shown[g] or _gain_shows(views, s, g) for g in GAINS)
    ]
    strips = [
        finger
        for finger, chain in CHAINS.items()
        if set(chain) <= set(by_gravity) and not set(chain) & set(named)
    ]
    could_turn = tuple(
        s for s in by_gravity if s in SEGMENT and s not in named and not _turn_shows(views, s)
    )
    together = set(synchrony.comparable_fingers(views.signals, LATE)) if views else set()
    return Untested(
        tuple(sensors),
        tuple(f for f in strips if f not in together and not _delay_shows(views, f)),
        _exchangeable(views, declared.geometry, [f for f in strips if f != "thumb"]),
        could_turn,
    )


def _exchangeable(
    views: Views | None, geometry: HandGeometry, fingers: Sequence[str]
) -> tuple[str, ...]:
    """Which of some long fingers could be on each other's place unseen."""
    if len(fingers) < 2:
        return ()
    seen = joint_places.roots(views.pairs) if views and views.pairs.explains else None
    if seen is None:
        return tuple(fingers)
    return tuple(f for f in joint_places.untested_fingers(seen, geometry) if f in fingers)


def shown_by_gravity(cells: Cells) -> dict[str, dict[float, bool]]:
    """By sensor of inertial streams and gain: whether gravity tells it, in movement or from one rest to the next."""
    if not len(begins(len(cells.valid))):
        return {s: dict.fromkeys(GAINS, False) for s in cells.sensors}
    right = information_of(windows_of(cells, np.eye(3)))
    shown: dict[str, dict[float, bool]] = {s: {} for s in cells.sensors}
    rests: rest_turns.Rests = {}
    for gain in GAINS:
        wrong = information_of(windows_of(cells, gain * np.eye(3)))
        moving = gyroscope_check.p_values_of_gain(right, wrong) < FALSE_ALARMS
        turns = rest_turns.find(cells, ~moving, gain * np.eye(3), rests)
        resting = {cells.sensors[t.sensor] for t in turns if t.p_value < FALSE_ALARMS}
        for s, is_moving in zip(cells.sensors, moving):
            shown[s][gain] = bool(is_moving) or s in resting
    return shown


def _gain_shows(views: Views | None, sensor: str, gain: float) -> bool:
    if views is None or sensor not in views.pairs.series.sensors:  # the trunk's has no neighbour
        return False
    rates = views.rates
    wrong = rates.pairs.with_gain(sensor, 1.0 / gain)
    if gains.p_value_of(wrong, rates.pairs, sensor, gain) < FALSE_ALARM:
        return True
    if rates.explains and rate_tests.p_value_of_gain(rates, sensor, gain) < FALSE_ALARM:
        return True
    return any(
        u.p_value < FALSE_ALARM * len(wrong.joints) / len(rates.pairs.joints)
        for u in unexplained.find(wrong, views.others)
        if sensor in u.joint
    )


def _turn_shows(views: Views | None, sensor: str) -> bool:
    """Whether a turn of the sensor about the axis of flexion that its gyroscope sees would be told in most windows."""
    if views is None or not views.pairs.explains or sensor not in views.pairs.series.sensors:
        return False
    flexion = quat.rotate(quat.conjugate(views.pairs.q_BS[sensor]), np.array([0.0, 0.0, TURN]))
    return slips.share_shown(views.pairs, views.others, sensor, flexion) > HALF


def _delay_shows(views: Views | None, finger: str) -> bool:
    if views is None:
        return False
    rates = views.rates
    roots = [j for j in rates.pairs.joints if j[0] == "hand" and j[1] == CHAINS[finger][0]]
    by_rates = [j for j in roots if j in rates.joints and rates.explains]
    return all(
        any(rate_tests.p_value_of_delay(rates, j, late) < FALSE_ALARM for j in by_rates)
        or any(delays.p_value_of(rates.pairs, j, late) < FALSE_ALARM for j in roots)
        or any(vibration.p_value_of(views.vibration, j, late) < FALSE_ALARM for j in roots)
        for late in LATE
    )
