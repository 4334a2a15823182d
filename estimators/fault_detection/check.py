"""The checks that every recording goes through, and their findings.

In      blocks of a recording, or of what has come so far
Out     suspicions: what is probably wrong, which sensors, from when to when, how probable such evidence is without the fault
Limits  each sensor is checked against itself. Sensors against each other (neighbours/) is an experiment: it takes a simulated glove whose
        accelerations do not fit its joints for a late one, and costs 0.1 s of a processor a second; `handscope reproduce crosschecks`
"""

from collections.abc import Sequence

from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import Block
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.words import sentence


def check_recording(blocks: Sequence[Block]) -> list[Suspicion]:
    """What is probably wrong with a recording, or with what has come of it so far.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream, SI units, values in the sensors' frames.

    Returns
    -------
    list of Suspicion
        Faults of the file first, then those of single sensors.
    """
    return check_sensors(blocks)


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
