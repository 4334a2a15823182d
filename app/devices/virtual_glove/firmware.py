"""What runs inside a virtual glove: commands in, frames out, no port and no clock of its own.

Time is the glove's: seconds since its samples began. Samples are made a little ahead and sent when they are due, in bursts as a FIFO gives them.
"""

import heapq
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.app.devices.virtual_glove.flash import Flash
from handscope.app.devices.virtual_glove.wearer import Wearer
from handscope.estimators.data.samples import FORCE, GYR, MAG, TORQUE, Block, Stream
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.framing import LONGEST, Decoder, Encoder
from handscope.sessions.wire.sample_values import encode_values

AHEAD = 0.25  # s of samples made in one go
ANNOUNCE = 1.0  # s between repetitions of identity, strips and streams
SLOTS = (
    "hand",
    "thumb",
    "index",
    "middle",
    "ring",
    "little",
    "forearm",
    "trunk",
    "force",
    "trunk_mag",
)
NS = 1e9


@dataclass(frozen=True, kw_only=True)
class Build:
    """What distinguishes one virtual glove from another."""

    device_id: int = 0x5C09E
    boot_id: int = 1
    name: str = "Handscope virtual glove"
    firmware: str = "1.0"
    format: wire.Format = wire.Format.INT16
    burst: float = 0.01  # s of samples in one frame
    drift: float = 0.0  # of the base clock against true time, e.g. 20e-6
    forearm_drift: float = 35e-6  # of the wireless sensor's clock against the base unit's
    # s, least and mean delay of the radio: about 10 ms (Salchow-Hoemmen 2019, 2.1)
    forearm_delay: tuple[float, float] = 0.005, 0.01
    clock_start: float = 12.0  # s that the base clock shows when samples begin


@dataclass
class Firmware:
    """One powered-up glove."""

    wearer: Wearer
    build: Build
    rng: np.random.Generator
    flash: Flash = field(default_factory=Flash)  # outlives the firmware: it is the strips'
    running: bool = False
    overruns: int = 0  # frames dropped because nobody took the bytes
    _decoder: Decoder = field(default_factory=lambda: Decoder(ordered=False))
    _encoder: Encoder = field(default_factory=Encoder)
    _pulled: set[str] = field(default_factory=set)  # names of strips that are not plugged in
    _t: float = 0.0  # glove time reached
    _made: float = 0.0  # glove time up to which samples are made
    _announced: float = -np.inf
    # a heap by time of sending, then order of making
    _due: list[tuple[float, int, wire.Samples]] = field(default_factory=list)
    # when a stream's last burst is sent: a radio link keeps the order
    _sent: dict[int, float] = field(default_factory=dict)
    _order: int = 0
    _indices: dict[int, int] = field(default_factory=dict)

    def handle(self, received: bytes) -> bytes:
        """Answer commands; bytes may be cut anywhere."""
        return b"".join(
            self._frame(answer)
            for command in self._decoder.feed(received)
            for answer in self._answer(command)
        )

    def advance(self, seconds: float) -> list[bytes]:
        """Let true time pass and give the frames that became due."""
        self._t += seconds * (1 + self.build.drift) if self.running else 0.0
        frames = []
        if self._t - self._announced >= ANNOUNCE or not np.isfinite(self._announced):
            frames += (
                [self._frame(m) for m in (*self._descriptions(), self._status())]
                if self.running
                else []
            )
            self._announced = self._t if self.running else -np.inf
        while self.running and self._made < self._t + AHEAD:
            frames += [
                self._frame(self._mark(e.onset, e))
                for e in self.wearer.marks(self._made, self._made + AHEAD)
            ]
            self._make(self._made, self._made + AHEAD)
            self._made += AHEAD
        while self._due and self._due[0][0] <= self._t:
            frames.append(
                self._frame(replace(heapq.heappop(self._due)[2], t_sent=self._clock_ns(self._t)))
            )
        return frames

    def pull(self, name: str) -> bytes:
        """Pull a strip while running: its samples end."""
        self._pulled.add(name)
        numbers = {n for n, s in enumerate(self.wearer.streams) if s.name == name}
        self._due = [d for d in self._due if d[2].stream not in numbers]
        heapq.heapify(self._due)
        return b"".join(self._frame(self._strip(s)) for s in self._strips() if s.name == name)

    def plug(self, name: str) -> bytes:
        """Plug a strip in again."""
        self._pulled.discard(name)
        return b"".join(self._frame(m) for m in self._descriptions())

    def power_off(self) -> None:
        """Nothing is sent until the next start."""
        self.running = False
        self._due.clear()

    def _answer(self, command: wire.Message) -> list[wire.Message]:
        code = wire.encode(command)[0]
        ok = wire.Reply(code, wire.ReplyCode.OK)
        match command:
            case wire.Identify():
                return [*self._descriptions(), ok]
            case wire.Start():
                if not self.running:
                    self.running, self._announced, self._made = (
                        True,
                        -np.inf,
                        max(self._made, self._t),
                    )
                return [*self._descriptions(), ok]
            case wire.Stop():
                self.power_off()
                return [ok]
            case wire.Ping():
                return [wire.Pong(command.token, self._clock_ns(self._t))]
            case wire.Cue():
                if self.wearer.cue(command.task, command.details, self._made):
                    return [ok]
                return [
                    wire.Reply(
                        code,
                        wire.ReplyCode.BAD_ARGUMENT,
                        f"the wearer does not know {command.task!r}",
                    )
                ]
            case wire.Configure():
                return self._configure(command, ok)
            case wire.ReadCalibration():
                return [
                    *(
                        m
                        for s in self._strips()
                        if self._slot(s) == command.slot
                        for m in self._calibrations(s)
                    ),
                    ok,
                ]
            case wire.WriteCalibration():
                return self._write_calibration(command.calibration, ok)
        return [wire.Reply(code, wire.ReplyCode.UNKNOWN_COMMAND)]

    def _configure(self, command: wire.Configure, ok: wire.Reply) -> list[wire.Message]:
        if self.running:
            return [replace(ok, code=wire.ReplyCode.BUSY, text="stop first")]
        if not 0 <= command.rate <= 1000:
            return [replace(ok, code=wire.ReplyCode.BAD_ARGUMENT, text="rates go up to 1000 Hz")]
        if command.rate > 0:
            affected = [
                command.slot in (wire.ALL_SLOTS, SLOTS.index(s.name)) for s in self.wearer.streams
            ]
            self.wearer.streams = tuple(
                replace(s, rate=command.rate) if a else s
                for s, a in zip(self.wearer.streams, affected)
            )
        self.build = replace(self.build, format=command.format)
        return [*self._descriptions(), ok]

    def _write_calibration(
        self, calibration: wire.StripCalibration, ok: wire.Reply
    ) -> list[wire.Message]:
        if self.running:
            return [replace(ok, code=wire.ReplyCode.BUSY, text="stop first")]
        strip = next(
            (
                s
                for s in self._strips()
                if self._slot(s) == calibration.slot and s.name not in self._pulled
            ),
            None,
        )
        if strip is None or not self.flash.store(strip.name, calibration):
            text = f"no flash for sensor {calibration.sensor} of slot {calibration.slot}"
            return [replace(ok, code=wire.ReplyCode.BAD_ARGUMENT, text=text)]
        return [*self._calibrations(strip), ok]

    def _descriptions(self) -> list[wire.Message]:
        b = self.build
        messages: list[wire.Message] = [
            wire.Identity(b.device_id, b.boot_id, self.wearer.hand, b.name, b.firmware)
        ]
        for s in self._strips():
            messages += [
                self._strip(s),
                *(
                    self._calibrations(s)
                    if self.flash.is_raw(s) and s.name not in self._pulled
                    else ()
                ),
            ]
        if self.wearer.plate is not None:
            messages.append(self.wearer.plate)
        return messages + [
            self._info(n, s)
            for n, s in enumerate(self.wearer.streams)
            if s.name not in self._pulled
        ]

    def _strips(self) -> list[Stream]:
        """One stream of each strip, for its sensors."""
        return list({s.name: s for s in reversed(self.wearer.streams)}.values())[::-1]

    def _slot(self, s: Stream) -> int:
        return (
            SLOTS.index(s.name)
            if s.name in SLOTS
            else len(SLOTS) + sorted(x.name for x in self._strips()).index(s.name)
        )

    def _calibrations(self, s: Stream) -> list[wire.StripCalibration | ForceSensorCalibration]:
        return self.flash.calibration_messages(s, self._slot(s))

    def _strip(self, s: Stream) -> wire.Strip:
        slot, raw = self._slot(s), self.flash.is_raw(s)
        q = [self.wearer.mounting.get(point, np.array([1.0, 0, 0, 0])) for point in s.sensors]
        mounting = tuple(float(x) for x in np.concatenate(q)) if self.wearer.mounting else ()
        return wire.Strip(
            slot,
            s.name not in self._pulled,
            0xA000 + 16 * self.build.device_id + slot,
            s.sensors,
            mounting,
            raw,
        )

    def _info(self, number: int, s: Stream) -> wire.StreamInfo:
        limits = self.flash.full_scale(s)
        full = tuple(float(limits.get(q, 0.0)) for q in s.quantities)
        counts = self.build.format is wire.Format.INT16
        limit = {GYR: 40.0, MAG: 4.9e-3, FORCE: 100.0, TORQUE: 1.0}
        scale = tuple(
            (f or limit.get(q, 160.0)) / 32767 if counts else 1.0
            for q, f in zip(s.quantities, full)
        )
        return wire.StreamInfo(
            number,
            self._strip(s).slot,
            self._own_clock(s),
            s.quantities,
            self.build.format,
            s.rate,
            scale,
            full,
        )

    def _own_clock(self, s: Stream) -> int:
        return 1 if s.clock == "forearm" else 0

    def _make(self, start: float, stop: float) -> None:
        """Samples of [start, stop) of every plugged stream, to be sent when they are due."""
        for number, stream in enumerate(self.wearer.streams):
            if stream.name in self._pulled:
                continue
            for at, samples in self._bursts(
                number, stream, self.wearer.samples(stream, start, stop)
            ):
                self._sent[number], self._order = (
                    max(at, self._sent.get(number, at)),
                    self._order + 1,
                )
                heapq.heappush(self._due, (self._sent[number], self._order, samples))

    def _bursts(
        self, number: int, stream: Stream, block: Block
    ) -> list[tuple[float, wire.Samples]]:
        info = self._info(number, stream)
        room = (LONGEST - 64) // (
            len(stream.sensors)
            * 3
            * len(stream.quantities)
            * (2 if info.format is wire.Format.INT16 else 4)
        )
        most = max(1, min(255, room, round(self.build.burst * stream.rate)))
        values, made = self.flash.readings(stream, block.values), []
        for first, last in _runs(block.t, stream.rate, most):
            delay = 0.0
            if info.clock:
                least, mean = self.build.forearm_delay
                delay = least + float(self.rng.exponential(mean - least))
            index = self._indices.get(number, 0)
            self._indices[number] = index + last - first
            data = encode_values(values[first:last], info)
            own = (
                self._clock_ns(float(block.t[first]))
                if not info.clock
                else round(NS * (5.0 + block.t[first] * (1 + self.build.forearm_drift)))
            )
            made.append(
                (
                    float(block.t[last - 1]) + delay,
                    wire.Samples(number, index, own, 0, last - first, data),
                )
            )
        return made

    def _mark(self, onset: float, event: object) -> wire.Mark:
        trial_type, details, duration = (
            getattr(event, name) for name in ("trial_type", "details", "duration")
        )
        return wire.Mark(
            self._clock_ns(onset),
            round(NS * duration),
            trial_type,
            {k: str(v) for k, v in details.items()},
        )

    def _status(self) -> wire.Status:
        return wire.Status(self._clock_ns(self._t), self.overruns, 255, 31.0)

    def _clock_ns(self, t: float) -> int:
        return round(NS * (self.build.clock_start + t))

    def _frame(self, message: wire.Message) -> bytes:
        return self._encoder.frame(message)


def _runs(t: np.ndarray, rate: float, most: int) -> list[tuple[int, int]]:
    """Cut samples into bursts of at most `most`, each evenly spaced to a microsecond so that one time stamp describes them all."""
    runs, first = [], 0
    for k in range(1, len(t) + 1):
        if k == len(t) or k - first == most or abs(t[k] - t[first] - (k - first) / rate) > 1e-6:
            runs.append((first, k))
            first = k
    return runs
