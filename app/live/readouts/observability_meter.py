"""The live meter of free movement: the observability of each joint by self-calibration so far.

Updated once a second from the tracker's buffered samples and poses, in a thread of its own: tick and method do not wait.
"""

import logging
import threading
from collections.abc import Sequence

import numpy as np

from handscope.app.live.tracking import Tracking
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FLEXION, JOINT, SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import observability, sample_preparation
from handscope.estimators.self_calibration.observability import (
    AccumulatedInformation,
    JointObservability,
    Limb,
)
from handscope.estimators.self_calibration.problem import Noise
from handscope.estimators.self_calibration.result import Requirements

log = logging.getLogger(__name__)
EVERY = 1.0  # s of samples that are taken in at a time
LATE = 0.3  # s after which the last strip's samples have come
THIN = 5  # every so many poses count for a joint's excursion


class FreeMeter:
    """Of one stretch of free movement, from `onset` (s of the recording) on."""

    def __init__(self, tracking: Tracking, onset: float) -> None:
        self._tracking, self._until = tracking, onset
        self._fingers: dict[str, tuple[Limb, AccumulatedInformation]] = {}
        self._flexion: list[Array] = []
        self._thread: threading.Thread | None = None
        self._whole: tuple[
            JointObservability, ...
        ] = ()  # of the best stretch before the newest hole
        self.observed: tuple[JointObservability, ...] = ()

    @property
    def is_enough(self) -> bool:
        """Whether everything that self-calibration estimates is observable."""
        return bool(self.observed) and all(o.share >= 1.0 for o in self.observed)

    def follow(self) -> None:
        """Take in the newest second, once it is complete and the one before is processed."""
        stop = self._tracking.newest_sample() - LATE
        if (
            stop - self._until >= EVERY
            and self._tracking.calibration is not None
            and not (self._thread and self._thread.is_alive())
        ):
            start, self._until = self._until, stop
            self._thread = threading.Thread(
                target=self.advance, args=(start, stop), name="free movement", daemon=True
            )
            self._thread.start()

    def advance(self, start: float, stop: float) -> None:
        """Take in a stretch, s."""
        try:
            calibration, rows = self._tracking.calibration, self._tracking.past(start, stop)
            if calibration is None or not len(rows):
                return
            blocks = [
                b.between(start, stop) for b in self._tracking.samples(start) if b.stream.inertial
            ]
            blocks = [b for b in blocks if len(b.t) > 2]
            if sample_preparation.find_gaps(blocks, start, stop):
                self._begin_anew()
                return
            self._flexion.append(rows.angles[::THIN, :, FLEXION])
            self._take_in(calibration, rows, blocks)
        except Exception:  # the station goes on, and the movement, too
            log.exception("the observability of free movement could not be computed")

    def _begin_anew(self) -> None:
        """Start a new stretch: self-calibration uses the longest one without gaps."""
        self._whole = self.observed
        self._fingers, self._flexion = (
            {
                f: (limb, observability.no_information(limb))
                for f, (limb, _) in self._fingers.items()
            },
            [],
        )

    def _take_in(self, calibration: Calibration, rows: Trajectory, blocks: Sequence[Block]) -> None:
        worn = {s for b in blocks for s in b.stream.sensors}
        for finger, links in CHAINS.items():
            if finger not in self._fingers and {"hand", links[0]} <= worn:
                limb = observability.build_limb(
                    finger, sorted(worn), self._tracking.geometry, calibration.q_BS
                )
                if silent := _silent(limb, blocks):  # self-calibration leaves them out, too
                    limb = observability.build_limb(
                        finger,
                        sorted(worn - set(silent)),
                        self._tracking.geometry,
                        calibration.q_BS,
                    )
                if limb.links.joints:
                    self._fingers[finger] = limb, observability.no_information(limb)
        flexion, observed = np.concatenate(self._flexion), list[JointObservability]()
        for finger, (limb, before) in self._fingers.items():
            information = _accumulate(calibration, limb, before.noise, rows, blocks)
            so_far = (
                before
                if information is None
                else observability.add_information(before, information)
            )
            self._fingers[finger] = limb, so_far
            of_joints = {joint: flexion[:, JOINT[joint]] for joint in limb.links.joints}
            observed += observability.assess_joints(Requirements(), limb, so_far, of_joints)
        self.observed = max(self._whole, tuple(observed), key=_worth)


def _worth(observed: Sequence[JointObservability]) -> float:
    """Rank of a stretch: the share of its least observable joint."""
    return min((o.share for o in observed), default=0.0)


def _silent(limb: Limb, blocks: Sequence[Block]) -> tuple[str, ...]:
    """Which of the limb's sensors give less than half of their samples, and those behind the first of them."""
    return sample_preparation.drop_silent_sensors(blocks, limb.links, -np.inf, np.inf)[1]


def _accumulate(
    calibration: Calibration, limb: Limb, noise: Noise, rows: Trajectory, blocks: Sequence[Block]
) -> AccumulatedInformation | None:
    """Information that a stretch gives about a finger; None where a sensor is silent or has no orientation."""
    own = [b for b in blocks if set(b.stream.sensors) & set(limb.links.sensors)]
    if not {s for b in own for s in b.stream.sensors} >= set(limb.links.sensors) or _silent(
        limb, own
    ):
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
