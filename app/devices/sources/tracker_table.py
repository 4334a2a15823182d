"""Which sensor of a source sits on which segment: as the device or a map says, unless a person says otherwise; and which one is being shaken.

In      samples with the name of their sensor, levels of batteries and radio, taps
Out     the same samples at the segment where they belong; a row a sensor for people
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handscope.app.devices.sources.source import Level, Measured
from handscope.estimators.data.samples import GYR, ORIENTATION
from handscope.estimators.numerics.typing import Array

SHAKEN = 1.0  # rad/s from which the fastest sensor is the one that somebody moves
FORGET = 0.3  # s in which a sensor's motion counts less by e
TAPPED = 2.0  # s that a tap is shown
SHORTEST = 0.005  # s: samples that arrive together have no times of their own
MOST_SENSORS = 64
NS = 1e-9


@dataclass
class _Sensor:
    """What is known of one sensor."""

    own: str  # segment by the device or the map; empty where neither says
    rate: float = 0.0  # rad/s, recent
    at: int = 0  # ns, newest sample
    q: Array | None = None  # newest orientation (4,)
    tapped: float = -np.inf  # s


class TrackerTable:
    """Feed it what a source gives; not safe for several threads."""

    def __init__(self) -> None:
        self._sensors: dict[str, _Sensor] = {}
        self._levels: dict[str, Level] = {}  # by device
        self._places: dict[str, str] = {}  # by a person; empty: not worn

    def place(self, places: Mapping[str, str]) -> set[str]:
        """Take over where a person says that sensors sit; gives the segments that changed their sensor."""
        before = {name: self.place_of(name) for name in self._sensors}
        self._places = dict(places)
        after = {name: self.place_of(name) for name in self._sensors}
        changed = {
            p for name in before for p in (before[name], after[name]) if before[name] != after[name]
        }
        return changed - {""}

    def place_of(self, sensor: str) -> str:
        """The segment of a sensor; empty where it has none, or another sensor was put there."""
        if sensor in self._places:
            return self._places[sensor]
        own = self._sensors[sensor].own if sensor in self._sensors else ""
        return "" if own in self._places.values() else own

    def own_place(self, segment: str) -> str:
        """Where the source says that the sensor at a segment sits: the mounting it states is that sensor's."""
        name = next((n for n in self._sensors if self.place_of(n) == segment), "")
        return self._sensors[name].own if name else segment

    def placed(self, measured: Measured) -> Measured | None:
        """Samples at their segment; None where their sensor has none. Samples without a sensor's name, or of several points, pass."""
        if len(measured.points) > 1 or (not measured.sensor and measured.points):
            return measured
        sensor = self._note(measured)
        place = self.place_of(measured.sensor) if sensor else ""
        return replace(measured, points=(place,)) if place else None

    def note_level(self, level: Level) -> None:
        """Battery or radio of a device, whose name begins those of its sensors."""
        if level.device in self._levels or len(self._levels) < MOST_SENSORS:
            before = self._levels.get(level.device, Level(level.device))
            battery = before.battery if level.battery is None else level.battery
            signal = before.signal if level.signal is None else level.signal
            self._levels[level.device] = Level(level.device, battery, signal)

    def note_tap(self, sensor: str, now: float) -> None:
        """Somebody tapped a sensor."""
        if sensor in self._sensors:
            self._sensors[sensor].tapped = now

    def rows(self, now: float) -> list[dict[str, Any]]:
        """A row a sensor, for pages; `now` in s of the host's monotonic clock."""
        recent = {
            n: s.rate * np.exp(-max(0.0, now - s.at * NS) / FORGET)
            for n, s in self._sensors.items()
        }
        fastest = max(recent, key=lambda n: recent[n], default="")
        return [
            {
                "sensor": name,
                "place": self.place_of(name),
                "by_person": name in self._places,
                "moving": name == fastest and bool(recent[name] > SHAKEN),
                "tapped": now - s.tapped < TAPPED,
                "battery": self._level_of(name).battery,
                "signal": self._level_of(name).signal,
            }
            for name, s in sorted(self._sensors.items())
        ]

    def _level_of(self, sensor: str) -> Level:
        """What is known of the device whose name a sensor's begins with."""
        device = sensor if sensor in self._levels else sensor.rpartition("/")[0]
        return self._levels.get(device, Level(device))

    def _note(self, measured: Measured) -> _Sensor | None:
        if measured.sensor not in self._sensors:
            if len(self._sensors) >= MOST_SENSORS:
                return None
            self._sensors[measured.sensor] = _Sensor(measured.points[0] if measured.points else "")
        sensor = self._sensors[measured.sensor]
        rate = _rate(measured, sensor)
        passed = (int(measured.t[-1]) - sensor.at) * NS
        sensor.rate = max(rate, sensor.rate * float(np.exp(-max(passed, 0.0) / FORGET)))
        sensor.at = int(measured.t[-1])
        return sensor


def _rate(measured: Measured, sensor: _Sensor) -> float:
    """The turn in a piece, rad/s: by its gyroscope, or from one orientation to the next."""
    if GYR in measured.quantities:
        first = 3 * measured.quantities.index(GYR)
        return float(
            np.nanmax(
                np.linalg.norm(measured.values[:, 0, first : first + 3], axis=-1), initial=0.0
            )
        )
    if measured.quantities != (ORIENTATION,):
        return 0.0
    q, t = measured.values[:, 0], measured.t
    before, sensor.q = sensor.q, q[-1]
    if before is not None:
        q, t = np.vstack([before, q]), np.concatenate([[sensor.at], t])
    if len(q) < 2:
        return 0.0
    cosines = np.minimum(1.0, np.abs(np.sum(q[1:] * q[:-1], axis=-1)))  # of half the angles
    turned = float(np.nansum(2 * np.arccos(cosines)))
    return turned / max(float(t[-1] - t[0]) * NS, SHORTEST)
