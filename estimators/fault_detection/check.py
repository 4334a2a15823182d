"""The checks that every recording goes through, and their findings.

In      blocks of a recording, or of what has come so far; what is declared of it
Out     suspicions: what is probably wrong, which sensors, from when to when, how probable such evidence is without the fault
Limits  those of the checks: single_sensors/ and neighbours/. Against each other only those sensors are looked at that are right by themselves, without stretches in which they stand still
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.neighbours import check_neighbours
from handscope.estimators.fault_detection.neighbours.check_neighbours import Compared
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors

MOST_FAULTY = 4  # sensors at fault beside which the others are compared: more have one cause
FROZEN = "sensor.frozen"  # at fault in stretches alone
SLIP, UNEXPLAINED = "sensor.slipped", "sensors.disagree"
SIZE = "sensor.accelerometer_size"  # its error turns with the sensor, so that no joint fits
EXPLAIN_STEPS = ("sensors.late", "sensors.early", "sensors.exchanged", "sensors.order")


def check_recording(
    blocks: Sequence[Block],
    declared: Recording | None = None,
    calibrations: Sequence[Calibration] = (),
    compared: Compared | None = None,
) -> list[Suspicion]:
    """What is probably wrong with a recording, or with what has come of it so far.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream, SI units, values in the sensors' frames.
    declared : Recording, optional
        Hand, geometry and mounting; without it sensors are not checked against each other.
    calibrations : sequence of Calibration, optional
        How sensors are turned against their segments, where it is known better than nominally.
    compared : Compared, optional
        Of the same recording, where other checks share it.

    Returns
    -------
    list of Suspicion
        Faults of the file first, then those of single sensors, then of sensors against each other and the declared hand.
    """
    if declared is not None:
        compared = compared or Compared(blocks, declared, calibrations)
    alone = check_sensors(blocks, compared.cells if compared else None)
    alone = [s for s in alone if not _is_refuted(s, compared)]
    faults = [
        s for s in alone if s.message.severity == "fault" and "magnetometer" not in s.message.code
    ]
    frozen = [s for s in faults if s.message.code == FROZEN]
    faulty = {n for s in faults if s.message.code != FROZEN for n in s.sensors}
    if declared is None or len(faulty) > MOST_FAULTY:
        return alone
    if faults:
        rest = (_without(_without_stretches(b, frozen), faulty) for b in blocks)
        blocks = [b for b in rest if b.stream.sensors]
        compared = Compared(blocks, declared, calibrations)
    together = check_neighbours.check(
        blocks,
        declared.hand,
        declared.geometry,
        declared.mounting,
        calibrations,
        declared.events,
        compared,
    )
    return _without_explained([*alone, *together])


def _without(block: Block, sensors: Collection[str]) -> Block:
    """A block of the other sensors alone."""
    kept = [k for k, name in enumerate(block.stream.sensors) if name not in sensors]
    stream = replace(block.stream, sensors=tuple(block.stream.sensors[k] for k in kept))
    return replace(block, stream=stream, values=block.values[:, kept])


def _without_stretches(block: Block, frozen: Sequence[Suspicion]) -> Block:
    """A block without the readings of sensors while they stood still."""
    values = block.values
    for s in frozen:
        columns = np.flatnonzero([name in s.sensors for name in block.stream.sensors])
        for start, stop in s.spans if len(columns) else ():
            values = values if values is not block.values else values.copy()
            rows = np.flatnonzero((block.t >= start) & (block.t <= stop))
            values[np.ix_(rows, columns)] = np.nan
    return replace(block, values=values)


def _is_refuted(suspicion: Suspicion, compared: Compared | None) -> bool:
    """Whether joints are as they are in sensors that are right, and would not be if a gyroscope had the fault."""
    if suspicion.rates is None or len(suspicion.sensors) != 1 or compared is None:
        return False
    (sensor,), (span,), views = suspicion.sensors, suspicion.spans, compared.views
    if views is None or not views.pairs.explains or sensor not in views.pairs.series.sensors:
        return False
    return views.others.refute_rates(sensor, suspicion.rates, span)


def _without_explained(found: list[Suspicion]) -> list[Suspicion]:
    """Without a slip of a sensor of which the same, or a cause that explains its step, is known; the slip of a sensor, and an accelerometer of which gravity is off, explain joints that do not meet."""
    known = {n for s in found if s.message.code in (SLIP, SIZE) for n in s.sensors}
    kept: list[Suspicion] = []
    for s in found:
        others = [o for o in found if o is not s and {*o.sensors} & {*s.sensors}]
        is_known = any(
            o in kept if o.message.code == SLIP else o.message.code in EXPLAIN_STEPS for o in others
        )
        explained = s.message.code == UNEXPLAINED and bool(known & {*s.sensors})
        if not explained and not (s.message.code == SLIP and is_known):
            kept.append(s)
    return kept
