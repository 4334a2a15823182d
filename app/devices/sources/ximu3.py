"""x-IMU3s as a source, by x-io's own library: one connection or several.

In      ximu3://tcp/HOST:PORT, ximu3://serial/PORT or ximu3://usb/PORT, several separated by commas; ?map=FILE.json with the labels
        gx gy gz (deg/s), ax ay az (g), mx my mz, qw qx qy qz; of several connections CONNECTION/gx, such as 10.1.2.3:7000/gx
Out     samples at the device's own times, brought to the host's clock
Source  package ximu3 (x-IMU3 API, x-io Technologies); units of gyroscope and accelerometer as its user manual says
Limits  the magnetometer is in the device's own units: a map that names uT takes them as such
"""

import json
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from handscope.app.devices.sources.addresses import SourceAddress
from handscope.app.devices.sources.channel_labels import ChannelSet, channel_sets
from handscope.app.devices.sources.source import About, Arrived, Battery, Level, Measured
from handscope.estimators.data.samples import ACC, GYR
from handscope.estimators.errors import InputError
from handscope.sessions.files.original_messages import Original
from handscope.sessions.table_import.column_map import ColumnMap
from handscope.sessions.wire.clock_mapping import ClockMap

BAUD = 115200
MOST_WAITING = 10_000  # messages; then the oldest go and are counted
MOST_AT_ONCE = 2000
US = 1e-6  # s of the device's clock
FIELDS: Mapping[str, Mapping[str, str]] = {  # of a kind of message, by label
    "inertial": {
        **{f"g{c}": f"gyroscope_{c}" for c in "xyz"},
        **{f"a{c}": f"accelerometer_{c}" for c in "xyz"},
    },
    "magnetometer": {f"m{c}": c for c in "xyz"},
    "quaternion": {f"q{c}": c for c in "wxyz"},
}


OTHERS = (  # kinds that are kept as they came and nothing is made of
    "ahrs_status",
    "button",
    "earth_acceleration",
    "error",
    "euler_angles",
    "high_g_accelerometer",
    "linear_acceleration",
    "notification",
    "rotation_matrix",
    "rssi",
    "serial_accessory",
    "sync",
    "temperature",
)


def open_source(address: SourceAddress) -> "Devices":
    """Connect; InputError where a device does not answer or the map does not fit."""
    columns = address.columns()
    if columns is None:
        raise InputError("device.ximu3_map_missing", url=address.url)
    library = _library()
    kind, _, rest = address.what.partition("/")
    names = [name for name in rest.split(",") if name]
    devices = Devices(names, columns)
    for name in names:
        config = _config(library, kind, name, address.url)
        devices.connect(name, library.Connection(config))
    return devices


def _library() -> Any:
    try:
        import ximu3
    except ImportError:
        raise InputError("device.ximu3_package_missing") from None
    return ximu3


def _config(library: Any, kind: str, name: str, url: str) -> Any:
    host, _, number = name.rpartition(":")
    if kind == "tcp" and host and number.isdigit() and int(number) < 65536:
        return library.TcpConnectionConfig(host, int(number))
    if kind == "serial":
        return library.SerialConnectionConfig(name, BAUD, False)
    if kind == "usb":
        return library.UsbConnectionConfig(name)
    raise InputError("device.ximu3_address_form", url=url)


class Devices:
    """Connections that are open; the library calls back in threads of its own."""

    def __init__(self, names: Sequence[str], columns: ColumnMap) -> None:
        if not names:
            raise InputError("device.ximu3_address_missing")
        self._columns = columns
        self._sets = _by_device(names, columns)
        self._waiting: queue.Queue[tuple[str, str, Any, int]] = queue.Queue(MOST_WAITING)
        self._clocks = {name: ClockMap() for name in names}
        self._newest: dict[tuple[str, str], int] = {}
        self._connections: list[Any] = []
        self._dropped = 0
        self._rows: list[str] = []  # messages as they came, JSON
        self._names: dict[str, tuple[str, ...]] = {}  # what a message of a kind holds

    @property
    def about(self) -> About:
        """The devices together."""
        mounting = {p: s.mounting for p, s in self._columns.sensors.items()}
        number = int.from_bytes(",".join(sorted(self._sets)).encode()) % 2**40
        return About("x-IMU3", number, self._columns.hand, mounting=mounting)

    def connect(self, name: str, connection: Any) -> None:
        """Open a connection; InputError where nobody answers."""
        for kind in (*FIELDS, "battery", *OTHERS):
            getattr(connection, f"add_{kind}_callback")(self._hearer(name, kind))
        try:
            connection.open()
        except Exception as problem:  # the library's own errors
            self.close()
            raise InputError("device.ximu3_silent", name=name, problem=str(problem)) from None
        self._connections.append(connection)

    def _hearer(self, name: str, kind: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            try:
                self._waiting.put_nowait((name, kind, message, time.monotonic_ns()))
            except queue.Full:
                self._dropped += 1

        return take

    def receive(self, wait: float) -> Sequence[Arrived]:
        """What the devices sent."""
        found: list[Arrived] = []
        try:
            found += self._take(*self._waiting.get(timeout=wait))
            while len(found) < MOST_AT_ONCE:
                found += self._take(*self._waiting.get_nowait())
        except queue.Empty:
            pass
        return found

    def take_originals(self) -> Sequence[Original]:
        """Messages as the library gave them, a line each: connection, kind, the host's ns, fields in the device's units."""
        rows, self._rows = self._rows, []
        return [Original({"kind": "ximu3_messages"}, "\n".join(rows).encode())] if rows else []

    def counts(self) -> Mapping[str, int | float]:
        """Messages that came faster than they were read."""
        return {"messages_dropped": self._dropped}

    def close(self) -> None:
        """Close the connections."""
        for connection in self._connections:
            connection.close()

    def _take(self, name: str, kind: str, message: Any, now: int) -> Sequence[Arrived]:
        self._rows.append(
            json.dumps([name, kind, now, self._fields(kind, message)], default=_plain)
        )
        if kind in OTHERS:
            return []
        if kind == "battery":
            percent = round(min(max(message.percentage, 0.0), 100.0))
            return [Battery(now, percent), Level(name, battery=percent)]
        clock = self._clocks[name]
        clock.update(message.timestamp * US, now * 1e-9)
        t = round(clock.local(message.timestamp * US) * 1e9)
        t = max(t, self._newest.get((name, kind), -1) + 1)
        self._newest[name, kind] = t
        values = {label: float(getattr(message, f)) for label, f in FIELDS[kind].items()}
        found = []
        for channels in self._sets[name]:
            labels = [str(label).rsplit("/", 1)[-1] for label in channels.labels]
            if all(label in values for label in labels):
                numbers = np.array([values[label] for label in labels]) * channels.factors
                at = np.array([t], np.int64)
                found.append(
                    Measured(
                        (channels.point,),
                        channels.quantities,
                        at,
                        numbers[None, None],
                        sensor=name,
                    )
                )
        return found

    def _fields(self, kind: str, message: Any) -> dict[str, Any]:
        """What a message holds, by the library's names."""
        if kind not in self._names:
            public = [n for n in dir(message) if not n.startswith("_")]
            self._names[kind] = tuple(n for n in public if not callable(getattr(message, n)))
        return {n: getattr(message, n) for n in self._names[kind]}


def _plain(value: Any) -> str:
    return value.hex() if isinstance(value, bytes) else str(value)


def _by_device(names: Sequence[str], columns: ColumnMap) -> dict[str, list[ChannelSet]]:
    """Channel sets by connection, of one kind of message each; InputError for labels that are none."""
    found: dict[str, list[ChannelSet]] = {name: [] for name in names}
    known = {label for fields in FIELDS.values() for label in fields}
    for channels in _split(channel_sets(columns)):
        parts = [str(label).rpartition("/") for label in channels.labels]
        devices = {device or (names[0] if len(names) == 1 else "") for device, _, _ in parts}
        if len(devices) != 1 or not devices <= set(names) or {p[2] for p in parts} - known:
            raise InputError(
                "device.ximu3_labels",
                point=channels.point,
                labels=", ".join(map(str, channels.labels)),
            )
        found[devices.pop()].append(channels)
    return found


def _split(sets: Sequence[ChannelSet]) -> list[ChannelSet]:
    """Magnetometers come in messages of their own."""
    found = []
    for c in sets:
        inertial = sum(q in (GYR, ACC) for q in c.quantities)
        n = 3 * inertial
        parts = (
            ChannelSet(c.point, c.quantities[:inertial], c.labels[:n], c.factors[:n]),
            ChannelSet(c.point, c.quantities[inertial:], c.labels[n:], c.factors[n:]),
        )
        found += [part for part in parts if part.quantities]
    return found
