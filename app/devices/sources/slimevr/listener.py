"""SlimeVR trackers as a source: a UDP socket that answers their handshakes and takes their orientations.

In      slimevr://[HOST:]PORT[?map=FILE.json]; labels of channels are MAC/SENSOR/qw, qx, qy, qz and gx to gz, ax to az, mx to mz
Out     orientations at the time they came, raw samples where the map asks for them, taps as annotations, the weakest battery
Source  packets.py
Limits  the trackers state no times of their own: what waits in the radio is late, what waits in this machine is not. Packets from addresses that have not shaken hands, or
        that are not of this network, are dropped and counted
"""

import ipaddress
import math
import select
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.app.devices.sources.channel_labels import ChannelSet, channel_sets
from handscope.app.devices.sources.slimevr import datagrams, packets
from handscope.app.devices.sources.slimevr.positions import PLACES
from handscope.app.devices.sources.source import About, Arrived, Battery, Level, Measured, Occurred
from handscope.estimators.data.samples import ORIENTATION
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.sessions.files.original_messages import Original
from handscope.sessions.table_import.column_map import ColumnMap

Address = tuple[str, int]
KEEP_ALIVE = 0.5  # s between two heartbeats to each tracker
MOST_TRACKERS = 64  # that may be connected
MOST_AT_ONCE = 500  # datagrams read in one go


class Listener:
    """An open socket; the trackers that have shaken hands."""

    def __init__(
        self,
        host: str,
        port: int,
        columns: ColumnMap | None,
        came: Callable[[int], int] = lambda waited: time.monotonic_ns() - waited,
    ) -> None:
        self._came = came  # ns, when a datagram came that has waited so many ns
        self._socket = datagrams.listen(host, port)
        self._trackers: dict[Address, str] = {}  # MAC by address
        self._numbers: dict[Address, int] = {}  # newest packet
        self._places: dict[str, str] = {}  # tracked point by MAC/SENSOR, as the firmware says
        self._hand: Hand | None = columns.hand if columns else None
        self._sets = _by_sensor(columns)
        self._mounting = {p: s.mounting for p, s in columns.sensors.items()} if columns else {}
        self._levels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._alive = -math.inf

    @property
    def about(self) -> About:
        """Who sends: the trackers together."""
        number = int.from_bytes(b"slime") ^ hash_of(self._sets)
        return About("SlimeVR trackers", number, self._hand, mounting=self._mounting)

    @property
    def port(self) -> int:
        """The UDP port that is listened at."""
        return int(self._socket.getsockname()[1])

    def receive(self, wait: float) -> Sequence[Arrived]:
        """What the datagrams that are there hold."""
        self._keep_alive()
        if not select.select([self._socket], [], [], wait)[0]:
            return []
        found: list[Arrived] = []
        for _ in range(MOST_AT_ONCE):
            try:
                datagram, address, waited = datagrams.receive(self._socket)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # a tracker that we answered is gone
            found += self._take(datagram, address, self._came(waited))
        return _join_samples(found)

    def take_originals(self) -> Sequence[Original]:
        """None: of packets only what is read is kept."""
        return ()

    def counts(self) -> Mapping[str, int | float]:
        """Datagrams by what became of them, newest signal strengths."""
        return dict(self._counts)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def _take(self, datagram: bytes, address: Address, now: int) -> Iterator[Arrived]:
        """What one datagram holds; nothing that a tracker sends may stop the others."""
        try:
            if not self._is_expected(datagram, address):
                return
            for packet in packets.packets_of(datagram):
                yield from self._answer(packet, address, now)
        except packets.CutShortError:
            self._counts["packets_cut_short"] += 1

    def _is_expected(self, datagram: bytes, address: Address) -> bool:
        """Whether a datagram is a handshake of this network, or the next one of who has shaken hands."""
        number = packets.number_of(datagram)
        if packets.HEAD.unpack_from(datagram)[0] == packets.HANDSHAKE:
            known = address in self._trackers or len(self._trackers) < MOST_TRACKERS
            if not (known and ipaddress.ip_address(address[0]).is_private):
                self._counts["handshakes_refused"] += 1
                return False
            self._numbers.pop(address, None)
            return True
        if address not in self._trackers:
            self._counts["packets_of_strangers"] += 1
            return False
        if number <= self._numbers.get(address, -1):
            self._counts["packets_out_of_order"] += 1
            return False
        self._numbers[address] = number
        return True

    def _answer(self, packet: packets.Packet, address: Address, now: int) -> Iterator[Arrived]:
        mac = self._trackers.get(address, "")
        match packet:
            case packets.Handshake():
                mac = packet.mac or address[0]
                self._trackers = {a: m for a, m in self._trackers.items() if m != mac}
                self._trackers[address] = mac
                self._send(packets.HELLO, address)
            case packets.Asked(kind=packets.FEATURES):
                self._send(packets.features(), address)
            case packets.SensorInfo():
                self._send(packets.sensor_known(packet), address)
                self._place(f"{mac}/{packet.sensor}", packet.position)
            case packets.Rotation():
                values = dict(zip(("qw", "qx", "qy", "qz"), packet.q))
                yield from self._take_sample(f"{mac}/{packet.sensor}", values, now)
            case packets.Raw():
                names = [q + c for q in "gam" for c in "xyz"]
                numbers = (*packet.gyr, *packet.acc, *packet.mag)
                yield from self._take_sample(
                    f"{mac}/{packet.sensor}", dict(zip(names, numbers)), now
                )
            case packets.Tap():
                details = {"note": "tap", "tracker": f"{mac}/{packet.sensor}"}
                yield Occurred(now, "annotation", details)
            case packets.BatteryLevel():
                if math.isfinite(packet.share):
                    self._levels[mac] = round(100 * min(max(packet.share, 0.0), 1.0))
                    yield Level(mac, battery=self._levels[mac])
                    yield Battery(now, min(self._levels.values()))
            case packets.Signal():
                self._counts[f"signal_dbm {mac}"] = packet.dbm
                yield Level(mac, signal=packet.dbm)

    def _place(self, sensor: str, position: int | None) -> None:
        """Where the firmware says that a sensor sits, unless the map says otherwise."""
        place = PLACES.get(position or 0)
        if self._sets is None and place is not None and self._hand in (None, place[0]):
            self._hand, self._places[sensor] = place

    def _take_sample(
        self, sensor: str, values: Mapping[str, float], now: int
    ) -> Iterator[Measured]:
        for channels in self._channels(sensor):
            names = [str(label).rsplit("/", 1)[1] for label in channels.labels]
            if all(n in values for n in names):
                numbers = np.array([values[n] for n in names]) * channels.factors
                t = np.array([now], np.int64)
                yield Measured(
                    (channels.point,), channels.quantities, t, numbers[None, None], sensor=sensor
                )
        if not self._channels(sensor):
            self._counts["samples_of_sensors_without_a_place"] += 1
            yield from _orientation(sensor, values, now)

    def _channels(self, sensor: str) -> Sequence[ChannelSet]:
        if self._sets is not None:
            return self._sets.get(sensor, ())
        if sensor not in self._places:
            return ()
        labels = tuple(f"{sensor}/{c}" for c in ("qw", "qx", "qy", "qz"))
        return (ChannelSet(self._places[sensor], (ORIENTATION,), labels, (1.0,) * 4),)

    def _keep_alive(self) -> None:
        now = time.monotonic()
        if now - self._alive >= KEEP_ALIVE:
            self._alive = now
            for address in self._trackers:
                self._send(packets.heartbeat(), address)

    def _send(self, data: bytes, address: Address) -> None:
        try:
            self._socket.sendto(data, address)
        except OSError:
            self._counts["answers_not_sent"] += 1  # the tracker asks again


def _orientation(sensor: str, values: Mapping[str, float], now: int) -> Iterator[Measured]:
    """The orientation of a sensor of which nobody says where it sits."""
    if "qw" in values:
        numbers = np.array([values[n] for n in ("qw", "qx", "qy", "qz")])
        t = np.array([now], np.int64)
        yield Measured((), (ORIENTATION,), t, numbers[None, None], sensor=sensor)


def hash_of(sets: Mapping[str, Sequence[ChannelSet]] | None) -> int:
    """A number that is the same for the same sensors."""
    return int.from_bytes("".join(sorted(sets or ())).encode()) % 2**40


def _by_sensor(columns: ColumnMap | None) -> dict[str, list[ChannelSet]] | None:
    """Channel sets by MAC/SENSOR; InputError where a label is none of a tracker."""
    if columns is None:
        return None
    found: dict[str, list[ChannelSet]] = {}
    for channels in channel_sets(columns):
        sensors = {str(label).rsplit("/", 1)[0] for label in channels.labels}
        if len(sensors) != 1 or any(str(label).count("/") != 2 for label in channels.labels):
            raise InputError(
                "device.tracker_labels",
                point=channels.point,
                labels=", ".join(map(str, channels.labels)),
            )
        found.setdefault(sensors.pop(), []).append(channels)
    return found


def _join_samples(arrived: Sequence[Arrived]) -> list[Arrived]:
    """Samples of the same stream that came together as one piece, at increasing times."""
    together: dict[tuple[object, ...], list[Measured]] = {}
    rest: list[Arrived] = []
    for one in arrived:
        if isinstance(one, Measured):
            together.setdefault((one.sensor, one.points, one.quantities), []).append(one)
        else:
            rest.append(one)
    for parts in together.values():
        t = np.concatenate([p.t for p in parts])
        t = np.maximum.accumulate(t - np.arange(len(t))) + np.arange(len(t))
        values = np.concatenate([p.values for p in parts])
        rest.append(replace(parts[0], t=t, values=values))
    return rest
