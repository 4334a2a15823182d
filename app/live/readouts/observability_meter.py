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
from handscope.estimators.hand.anatomy import CHAINS, FLEXION, JOINT
from handscope.estimators.methods import map_gain
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import observability, sample_preparation
from handscope.estimators.self_calibration.observability import (
    AccumulatedInformation,
    JointObservability,
    Limb,
)
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
        # of the best stretch before the newest hole
        self._whole: tuple[JointObservability, ...] = ()
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
                limb = map_gain.limb_of(finger, worn, self._tracking.geometry, calibration, blocks)
                if limb.links.joints:
                    self._fingers[finger] = limb, observability.no_information(limb)
        flexion, observed = np.concatenate(self._flexion), list[JointObservability]()
        for finger, (limb, before) in self._fingers.items():
            information = map_gain.accumulate_stretch(calibration, limb, before.noise, rows, blocks)
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
