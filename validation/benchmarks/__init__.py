"""Speed and memory of the hot paths, measured: `handscope bench`. A new benchmark is a file here and a line in the table."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Literal

YARDSTICK = "(yardstick)"  # what the name of a metric ends in that others are shares of


@dataclass(frozen=True)
class Metric:
    """One measured number with what is wanted of it."""

    name: str
    value: float
    unit: str
    target: float | None
    better: Literal["higher", "lower"]

    @property
    def met(self) -> bool | None:
        if self.target is None:
            return None
        return self.value >= self.target if self.better == "higher" else self.value <= self.target


def share_of_yardstick(m: Metric, metrics: Sequence[Metric]) -> float | None:
    """A figure as a share of the yardstick of the same unit and run, which tells how fast the machine is at this hour."""
    is_one = m.name.endswith(YARDSTICK)
    of = (o.value for o in metrics if o.name.endswith(YARDSTICK) and o.unit == m.unit)
    return None if is_one or not (value := next(of, 0.0)) else m.value / value


BENCHES = {
    "batch": "every method over recordings of 16 sensors at 100 Hz, ekf also at 200 Hz: times real time, memory",
    "checks": "the checks of a minute of 16 sensors beside its estimate; their share of the tracker's processor time in a session",
    "cohort": "200 one-minute recordings by m2 on one process and on two: processor time of one beside VQF's, parallel efficiency",
    "live": "17 sensors at 200 Hz, one station, four viewers: latency from sample to web socket, CPU of the server",
    "load": "stations x viewers until the 99th percentile of latency is beyond 80 ms; how much of the machine and of the server's process is used",
    "map_live": "the experiment map-live beside ekf on free movement of a whole hand: lag, time of a step, errors of angles and tips",
    "pages": "data of every page with 1,000 patients and 10,000 sessions: time until it is there",
    "reach_and_hold": "a minute with the magnet, an object lifted with force sensors at 12 and 100 Hz: times real time",
    "recorder": "17 sensors at 1 kHz with the estimator blocked for 5 s: samples lost",
    "report": "the report of a whole assessment with the course of 20 sessions, in every language: time to write it",
    "self_calibration": "map over 10, 20 and 40 s of one finger, 20 and 40 s of a whole hand: time, how it grows with the recording, memory",
    "steps": "m2 and ekf, one step of one sample of 16 sensors: median and 99th percentile",
    "start": "start of the server to its first page; processor time of commands beside importing numpy and scipy",
}


def bench(name: str) -> Callable[[], list[Metric]]:
    """The function that measures; imported when it is asked for."""
    measure: Callable[[], list[Metric]] = import_module(
        f"handscope.validation.benchmarks.{name}"
    ).measure
    return measure
