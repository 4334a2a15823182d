"""All checks of a recording: single sensors first, then sensors against each other and the hand where single sensors are intact.

In      blocks of a recording, what is declared of hand and mounting, calibrations and events
Out     suspicions: what is probably wrong, which sensors, from when to when, how probable such evidence is without the fault
Limits  a fault of a single sensor also spoils the joints beside it: what the second kind of check says of those sensors is dropped
"""

from collections.abc import Mapping, Sequence

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.neighbours import check_neighbours
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array


def check_recording(
    blocks: Sequence[Block],
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    events: Sequence[Event],
) -> list[Suspicion]:
    """What is probably wrong with a recording, or with what has come of it so far.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream, SI units, values in the sensors' frames.
    hand, geometry, mounting
        What is declared; `mounting` holds q_BS (4,) by segment.
    calibrations, events
        In order of time; both may be empty.

    Returns
    -------
    list of Suspicion
        Faults of the file and of single sensors, then those that only neighbours show.
    """
    single = check_sensors(blocks)
    spoilt = {sensor for s in single if s.message.severity != "info" for sensor in s.sensors}
    between = check_neighbours.check(blocks, hand, geometry, mounting, calibrations, events)
    return single + [s for s in between if not spoilt & set(s.sensors)]


def as_findings(suspicions: Sequence[Suspicion]) -> list[Finding]:
    """A finding for each sensor of each suspicion, with the same sentence; questions about the person flag nothing and are left out."""
    return [
        Finding(
            sensor=sensor,
            kind=s.message.code,
            sentence=sentence(s.message),
            fix="",
            severity="fault" if s.message.severity == "fault" else "warning",
            spans=s.spans,
        )
        for s in suspicions
        if s.message.severity != "info"
        for sensor in s.sensors
    ]
