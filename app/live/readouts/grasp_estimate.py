"""Mass or stiffness of the grasped object in a live station, estimated outside the tick while a task with force sensors runs."""

import logging
import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from handscope.app.live.tracking import Tracking
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import FORCE
from handscope.estimators.force import fingertip_forces
from handscope.estimators.force.fingertip_forces import ForceParams
from handscope.estimators.measures.object_frame import SO_FAR
from handscope.estimators.numerics.typing import Array

log = logging.getLogger(__name__)
PAUSE = 0.7  # s between two estimates
NOW = 0.5  # s before the newest sample: force sensors send twelve times a second
EMPTY = 0.5  # s of a task in which nothing is gripped yet
BEFORE = 15.0  # s before a task, with an empty hand: the zeros of the force sensors
UNITS = {"mass": ("kg", 1.0), "stiffness": ("N/mm", 1e-3)}


class GraspEstimator:
    """Started by the station's tick, read by snapshots."""

    def __init__(self, tracking: Tracking) -> None:
        self._tracking = tracking
        self._thread: threading.Thread | None = None
        self._newest = -np.inf  # host's clock
        self._number: dict[str, Any] | None = None
        self._task, self._onset = "", np.inf  # of the estimate
        self._zeros: Mapping[str, Array] = {}  # of the force sensors, by finger

    def update(self, task: str, onset: float) -> None:
        """Start another estimate during a task that weighs or squeezes, if the last is old; never waits."""
        if onset != self._onset:
            self._task, self._onset, self._number, self._zeros = task, onset, None, {}
        calibration = self._tracking.calibration
        waits = self._thread is not None and self._thread.is_alive()
        if task in SO_FAR and calibration and not waits and time.monotonic() - self._newest > PAUSE:
            self._newest = time.monotonic()
            self._thread = threading.Thread(
                target=self._estimate,
                args=(task, onset, calibration),
                name="grasp estimate",
                daemon=True,
            )
            self._thread.start()

    def number_of(self, task: str | None) -> dict[str, Any] | None:
        """Live number with its standard deviation; None before the first estimate, or of another task."""
        return self._number if task == self._task else None

    def fingertip_forces(self, task: str | None) -> Array | None:
        """Forces (5, 3) of the fingertips now, N in the global frame; None where unknown."""
        calibration, now = self._tracking.calibration, self._tracking.newest_sample()
        if task != self._task or not self._zeros or calibration is None:
            return None
        rows = self._tracking.past(now - NOW)
        if not len(rows):
            return None
        return fingertip_forces.newest_forces(
            self._zeros,
            rows,
            self._tracking.samples(now - NOW),
            self._tracking.mounting,
            [calibration],
        )

    def _estimate(self, task: str, onset: float, calibration: Calibration) -> None:
        try:
            number = self._compute(task, onset, calibration)
        except Exception:  # the station goes on
            log.exception("what is held could not be estimated")
            return
        if onset == self._onset:
            self._number = number

    def _compute(self, task: str, onset: float, calibration: Calibration) -> dict[str, Any] | None:
        blocks = self._tracking.samples(onset - BEFORE)
        rows = self._tracking.past(onset - BEFORE)
        if not len(rows) or not any(FORCE in b.stream.quantities for b in blocks):
            return None
        if (
            onset == self._onset and not self._zeros
        ):  # from the empty hand: a lasting grip would pass for a zero
            self._zeros = fingertip_forces.estimate_zeros(
                ForceParams(), [b.between(onset - BEFORE, onset + EMPTY) for b in blocks]
            )
        forces, _ = fingertip_forces.attach_forces(
            ForceParams(), rows, blocks, self._tracking.mounting, [calibration]
        )
        name, estimate = SO_FAR[task]
        running = estimate(forces.between(onset, np.inf), self._tracking.geometry)
        rows_known = np.flatnonzero(np.isfinite(running.value)) if running else np.empty(0, int)
        if running is None or not len(rows_known):
            return None
        unit, factor = UNITS[name]
        value, sd = (factor * float(v[rows_known[-1]]) for v in (running.value, running.sd))
        return {"name": name, "value": round(value, 3), "unit": unit, "sd": round(sd, 3)}
