"""Whether a recording holds movement enough for self-calibration to gain from it, finger by finger.

A finger gains where it moved as self-calibration asks, and where that gives its lengths GAIN times as accurately as an average hand's are known.

In      a recording, a calibration, the movement as another method tracked it
Out     the fingers that gain; the information of one stretch about a finger
Source  observability.py, second by second as the live meter does
Limits  looks at LOOKS seconds spread over the stretch that would be calibrated from, and takes the others to tell as much
"""

from collections.abc import Sequence

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import GYR, Block, Recording
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FLEXION, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import observability, sample_preparation
from handscope.estimators.self_calibration.observability import AccumulatedInformation, Limb
from handscope.estimators.self_calibration.problem import Noise
from handscope.estimators.self_calibration.result import Requirements

LONGEST = 60.0  # s, of option `longest` of self-calibration
GAIN = 2.0  # times
WINDOW, LOOKS = 1.0, 15  # s whose information is summed at a time, and how many times


def gaining_fingers(
    recording: Recording, calibration: Calibration, moved: Trajectory
) -> tuple[str, ...]:
    """Of the fingers that hang together with the hand's sensor those that self-calibration would tell more of."""
    blocks = [b for b in whole_streams(list(recording.blocks())) if b.stream.inertial and len(b.t)]
    worn = {s for b in blocks for s in b.stream.sensors}
    start = max((b.t[0] for b in blocks), default=0.0)
    stop = min((b.t[-1] for b in blocks), default=0.0)
    if "hand" not in worn or not len(moved):
        return ()
    start, stop = max(start, float(moved.t[0])), min(stop, float(moved.t[-1]))
    start, stop = sample_preparation.longest_gapless(blocks, start, stop)
    if stop - start < Requirements().shortest:
        return ()
    start, stop = sample_preparation.most_excited_stretch(blocks, start, stop, LONGEST)
    rows = moved.between(start, stop)
    if not len(rows):
        return ()
    own = [b.between(start, stop) for b in blocks]
    return tuple(
        finger
        for finger, links in CHAINS.items()
        if links[0] in worn and _gains(finger, worn, recording, calibration, rows, own)
    )


def _gains(
    finger: str,
    worn: set[str],
    recording: Recording,
    calibration: Calibration,
    rows: Trajectory,
    blocks: Sequence[Block],
) -> bool:
    limb = limb_of(finger, worn, recording.geometry, calibration, blocks)
    flexion = {joint: rows.angles[:, JOINT[joint], FLEXION] for joint in limb.links.joints}
    asked = Requirements()
    excursions = [observability.flexion_excursion(f) for f in flexion.values()]
    if not excursions or np.degrees(min(excursions)) < asked.bent:
        return False  # whatever its readings tell: they cost a hundred times as much
    turning = [_turning(blocks, sensor) for sensor in (limb.links.sensors[-1], "hand")]
    if np.less(turning, [asked.moving, asked.hand_moving]).any():
        return False
    so_far = observability.no_information(limb)
    span = float(rows.t[-1] - rows.t[0]) - WINDOW
    looks = min(LOOKS, int(span / WINDOW) + 1)
    for first in rows.t[0] + np.linspace(0.0, span, looks):
        window = [b.between(first, first + WINDOW) for b in blocks]
        found = accumulate_stretch(
            calibration,
            limb,
            so_far.noise,
            rows.between(first, first + WINDOW),
            [b for b in window if len(b.t) > 2],
        )
        so_far = so_far if found is None else observability.add_information(so_far, found)
    so_far = observability.repeat(so_far, (span + WINDOW) / (looks * WINDOW))
    observed = observability.assess_joints(asked, limb, so_far, flexion)
    known = 1e-3 * Noise().length / GAIN
    return all(o.length_sd < known for o in observed)


def _turning(blocks: Sequence[Block], sensor: str) -> float:
    """Average turning (deg/s) of a sensor, as `messages.require_movement` asks for it."""
    rates = [
        b.of(GYR)[:, b.stream.sensors.index(sensor)] for b in blocks if sensor in b.stream.sensors
    ]
    gyr = np.concatenate(rates)
    return sample_preparation.average_turning(gyr[np.isfinite(gyr).all(axis=1)])


def limb_of(
    finger: str,
    worn: set[str],
    geometry: HandGeometry,
    calibration: Calibration,
    blocks: Sequence[Block],
) -> Limb:
    """The finger with the worn sensors that self-calibration uses: without silent ones, and without those behind the first of them."""
    limb = observability.build_limb(finger, sorted(worn), geometry, calibration.q_BS)
    if not (silent := _silent_sensors(limb, blocks)):
        return limb
    return observability.build_limb(finger, sorted(worn - set(silent)), geometry, calibration.q_BS)


def _silent_sensors(limb: Limb, blocks: Sequence[Block]) -> tuple[str, ...]:
    """Which of the limb's sensors give less than half of their samples, and those behind the first of them."""
    return sample_preparation.drop_silent_sensors(blocks, limb.links, -np.inf, np.inf)[1]


def accumulate_stretch(
    calibration: Calibration, limb: Limb, noise: Noise, rows: Trajectory, blocks: Sequence[Block]
) -> AccumulatedInformation | None:
    """Information that a stretch gives about a finger; None where a sensor is silent or has no orientation."""
    own = [b for b in blocks if set(b.stream.sensors) & set(limb.links.sensors)]
    sensors = {s for b in own for s in b.stream.sensors}
    if not len(rows) or not sensors >= set(limb.links.sensors) or _silent_sensors(limb, own):
        return None
    t, read = sample_preparation.prepare_readings(
        own, limb.links.sensors, max(b.t[0] for b in own), min(b.t[-1] for b in own)
    )
    row = min(int(np.searchsorted(rows.t, t[0])), len(rows) - 1)
    q_GS = np.stack(
        [
            quat.multiply(rows.q_GS[row, SEGMENT[s]], calibration.q_BS.get(s, quat.IDENTITY))
            for s in limb.links.sensors
        ]
    )
    return observability.accumulate(limb, read, q_GS, noise) if np.isfinite(q_GS).all() else None
