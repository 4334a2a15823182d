"""A recording in a notebook: opened from a file or made of arrays, with events that can be added."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.version import software_version
from handscope.estimators.data.samples import (
    ACC,
    FASTEST_RATE,
    GYR,
    MAG,
    SLOWEST_RATE,
    TRACKED_POINTS,
    Block,
    Event,
    Stream,
)
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.hand.anatomy import HANDS, JOINTS, Hand
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array
from handscope.estimators.recording_checks.check import suspicions_of, untested_of
from handscope.sessions import motion_bids
from handscope.sessions.files import frames
from handscope.sessions.files.recording import LoadedRecording

G = 9.80665  # m/s^2
UNITS: Mapping[str, Mapping[str, float]] = {
    GYR: {"rad/s": 1.0, "deg/s": np.pi / 180},
    ACC: {"m/s^2": 1.0, "g": G, "mg": 1e-3 * G},
    MAG: {"T": 1.0, "uT": 1e-6, "mG": 1e-7},
}


class AnalysisRecording:
    """Raw samples and events. What is not here (`events`, `samples`, `geometry`, ...) is that of `loaded`."""

    def __init__(self, loaded: LoadedRecording) -> None:
        self.loaded = loaded

    def __getattr__(self, name: str) -> Any:
        if name == "loaded":  # while it is being copied
            raise AttributeError(name)
        return getattr(self.loaded, name)

    def add_pose(
        self,
        onset: float,
        duration: float,
        thumb_cmc_deg: Sequence[float] | None = None,
        **measured_deg: float,
    ) -> None:
        """Say when the hand lay in the initial pose.

        Parameters
        ----------
        onset, duration
            s of the recording.
        thumb_cmc_deg
            Flexion, deviation, pronation of the thumb's CMC joint, deg; None: aligned with the fingers.
        **measured_deg
            Other angles that were measured, deg, by name: `index_mcp_deviation_deg=4` (docs/motion-bids.md).

        Raises
        ------
        InputError
            For an unknown angle, and for a stretch outside the recording.
        """
        details: dict[str, Any] = dict(measured_deg)
        known = {
            f"{j.name}_{a}{sd}_deg" for j in JOINTS for a in _freedoms(j) for sd in ("", "_sd")
        }
        if wrong := sorted(set(details) - known):
            raise InputError("analysis.unknown_pose_angle", wrong=wrong[0])
        if thumb_cmc_deg is not None:
            if len(thumb_cmc_deg) != 3:
                raise InputError("analysis.thumb_angle_form")
            names = ("flexion", "deviation", "pronation")
            details |= {f"thumb_cmc_{n}_deg": float(v) for n, v in zip(names, thumb_cmc_deg)}
        self._add(Event(onset, duration, "initial_pose", details))

    def add_task(self, name: str, onset: float, duration: float) -> None:
        """Say when a task was performed.

        Parameters
        ----------
        name
            Of the task; it chooses the measures (docs/measures.md).
        onset, duration
            s of the recording.

        Raises
        ------
        InputError
            For a stretch outside the recording.
        """
        self._add(Event(onset, duration, "task", {"task_name": name}))

    def check(self) -> Any:
        """What the checks find, the hand and its poses as they are declared.

        Returns
        -------
        pandas.DataFrame
            A row a finding: severity, code, sensors, message, and p_value, the probability of such readings without the fault;
            last what the movement is too little to test, without a p_value.

        Notes
        -----
        What is checked, and how: docs/checks.md.
        """
        found = suspicions_of(self.loaded)
        untested = untested_of(self.loaded, found).messages
        messages = [*(s.message for s in found), *untested]
        sensors = [", ".join(s.sensors) for s in found]
        return frames.frame(
            {
                "severity": [m.severity for m in messages],
                "code": [m.code for m in messages],
                "sensors": sensors + [", ".join(map(str, m.values.values())) for m in untested],
                "message": [sentence(m) for m in messages],
                "p_value": [s.p_value for s in found] + [float("nan")] * len(untested),
            }
        )

    def save_bids(self, path: str | PathLike[str], subject: str = "01", task: str = "hand") -> None:
        """Write it as Motion-BIDS.

        Parameters
        ----------
        path
            Of the folder; of a zip where the name ends so.
        subject, task
            Labels of letters and digits, for the files' names.

        Raises
        ------
        InputError
            For a label with other characters, and where the files cannot be written.
        """
        for name, label in (("subject", subject), ("task", task)):
            if not label.isalnum():
                raise InputError("analysis.label_form", name=name, label=label)
        motion_bids.write(self.loaded, Path(path), subject, task, software=software_version())

    def _add(self, event: Event) -> None:
        spans = [(b.t[0], b.t[-1]) for b in self.loaded.samples.values() if len(b.t)]
        start, end = min(a for a, _ in spans), max(b for _, b in spans)
        if not (event.duration > 0 and start <= event.onset and event.end <= end + 1e-6):
            raise InputError(
                "analysis.event_outside",
                trial_type=event.trial_type,
                onset=event.onset,
                duration=event.duration,
                start=start,
                end=end,
            )
        self.loaded = self.loaded.with_events((*self.loaded.events, event))


def from_arrays(
    t: Any,
    gyr: Any,
    acc: Any,
    segments: Sequence[str],
    hand: Hand,
    mag: Any = None,
    gyr_unit: str = "rad/s",
    acc_unit: str = "m/s^2",
    mag_unit: str = "T",
    mounting: Mapping[str, Sequence[float]] | None = None,
    geometry: Mapping[str, Any] | None = None,
) -> AnalysisRecording:
    """A recording of arrays.

    Parameters
    ----------
    t
        (n,) times in s, each later than the one before; of `datetime64` the s since the first.
    gyr, acc
        (n, sensors, 3) angular rate and specific force in the sensors' own frames; NaN or infinite is a missing sample.
    segments
        The segment that each sensor is on, such as "index_proximal" (docs/conventions.md).
    hand
        "left" or "right".
    mag
        (n, sensors, 3) magnetic field; None: no magnetometers.
    gyr_unit, acc_unit, mag_unit
        Of the arrays: rad/s or deg/s; m/s^2, g or mg; T, uT or mG.
    mounting
        q_BS (w, x, y, z) by segment: takes vectors from sensor to segment; identity where absent.
    geometry
        `HandGeometry` of docs/motion-bids.md, m.

    Returns
    -------
    AnalysisRecording
        The same samples in SI units, without events.

    Raises
    ------
    InputError
        For arrays of another shape, unknown segments or units, and times that do not rise or are no seconds.

    Notes
    -----
    Frames and signs: docs/conventions.md.

    Examples
    --------
    >>> import numpy as np, handscope as hs
    >>> t, still = np.arange(500) / 100, np.zeros((500, 2, 3))
    >>> rec = hs.from_arrays(t, still, still + [1, 0, 0], ["hand", "index_proximal"], "left", acc_unit="g")
    >>> rec.add_pose(1.0, 3.0)
    >>> [event.trial_type for event in rec.events]
    ['initial_pose']
    """
    if hand not in HANDS:
        raise InputError("analysis.hand_unknown", hand=hand)
    time = _seconds(t)
    names = tuple(segments)
    if wrong := [s for s in names if s not in TRACKED_POINTS]:
        raise InputError("analysis.unknown_segment", wrong=wrong[0])
    if len(set(names)) < len(names):
        raise InputError("analysis.segment_twice")
    given = [(GYR, gyr, gyr_unit), (ACC, acc, acc_unit)]
    given += [(MAG, mag, mag_unit)] if mag is not None else []
    values = [_si(kind, array, unit, (len(time), len(names), 3)) for kind, array, unit in given]
    rate = (len(time) - 1) / float(time[-1] - time[0])
    stream = Stream("arrays", names, tuple(kind for kind, _, _ in given), rate)
    array = np.concatenate(values, axis=-1)
    infinite = np.isinf(array)
    turned = {s: np.asarray(q, float) for s, q in (mounting or {}).items()}
    loaded = LoadedRecording(
        hand,
        sized(hand, measures_from(geometry or {})),
        {s: turned.get(s, np.array([1.0, 0, 0, 0])) for s in names},
        {"arrays": Block(stream, time, np.where(infinite, np.nan, array))},
        (),
        _infinite_words(infinite, names),
        source={"format": "arrays"},
    )
    return AnalysisRecording(replace(loaded))


def _infinite_words(infinite: np.ndarray, names: Sequence[str]) -> tuple[str, ...]:
    """A warning of how many values (n, sensors, columns) are infinite, and of which sensors."""
    if not infinite.any():
        return ()
    sensors = ", ".join(name for k, name in enumerate(names) if infinite[:, k].any())
    return (phrase("analysis.infinite_values", count=int(infinite.sum()), sensors=sensors),)


def _seconds(t: Any) -> Array:
    """Times (n,) s of numbers, or of dates, which count from the first."""
    time = np.asarray(t)
    if time.dtype.kind == "M" and time.size:
        time = time - time.flat[0]
    if time.dtype.kind == "m":
        known = ~np.isnat(time)
        time = np.where(known, time / np.timedelta64(1, "s"), np.nan)
    time = np.asarray(time, float)
    if time.ndim != 1 or len(time) < 2 or not (np.diff(time) > 0).all():
        raise InputError("analysis.time_form")
    rate = float(1 / np.median(np.diff(time)))
    if not SLOWEST_RATE <= rate <= FASTEST_RATE:
        raise InputError("analysis.rate_implausible", rate=rate)
    return time


def _si(kind: str, array: Any, unit: str, shape: tuple[int, int, int]) -> Array:
    if unit not in UNITS[kind]:
        raise InputError(
            "analysis.unknown_unit", kind=kind, unit=unit, units=", ".join(UNITS[kind])
        )
    values = np.asarray(array, float)
    if values.shape != shape:
        raise InputError(
            "analysis.array_shape", kind=kind, shape=str(values.shape), shape2=str(shape)
        )
    return values * UNITS[kind][unit]


def _freedoms(joint: Any) -> list[str]:
    return [("flexion", "deviation", "pronation")[a] for a in joint.dofs]
