"""Messages of one glove to blocks of samples on the recording's time base.

The recording's time is the base unit's clock from its first sample on. Other clocks (the wireless forearm) are mapped onto it by the time at which
the base unit sent their samples on; after the device began again, the host's arrival times carry the time on.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import (
    FORCE,
    Block,
    Event,
    Stream,
)
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.force_calibrations import StoredSetups
from handscope.sessions.wire import force_calibration
from handscope.sessions.wire.clock_mapping import ClockMap
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.frame_losses import FrameLosses, LossAttribution
from handscope.sessions.wire.framing import Counters, Decoder
from handscope.sessions.wire.messages import (
    Identity,
    Mark,
    Message,
    Pong,
    Reply,
    Samples,
    Status,
    StreamInfo,
    Strip,
    StripCalibration,
)
from handscope.sessions.wire.sample_values import has_expected_size
from handscope.sessions.wire.stream_reading import (
    Burst,
    Reading,
    describe_stream,
    make_reading,
    name_of,
    samples_of,
)
from handscope.sessions.wire.strip_calibration import correction_of

NS = 1e-9
SET_BACK = 0.1  # s; as much may a better map of a foreign clock set a burst back: its samples are squeezed together, not dropped
WAITING = 512  # bursts kept while their stream is not described yet: about 2 s of 17 sensors


@dataclass
class StreamCount:
    """What came of one stream."""

    samples: int = 0
    lost: int = 0  # by the sample counter, or dropped because they would run back in time
    # of the lost, those that are missing though every frame came: the glove never sent them
    unsent: int = 0
    saturated: int = 0  # samples with a value at the sensor's limit


@dataclass
class Assembler:
    """Feed it the bytes of one port with their arrival times; it never raises on what a device sends."""

    decoder: Decoder = field(default_factory=Decoder)
    correct: bool = True  # whether raw samples are corrected by the strips' calibrations; False gives what the sensors read
    identity: Identity | None = None
    status: Status | None = None
    strips: dict[int, Strip] = field(default_factory=dict)  # by slot, attached ones
    infos: dict[int, StreamInfo] = field(default_factory=dict)  # by stream number
    streams: dict[int, Stream] = field(default_factory=dict)
    counts: dict[str, StreamCount] = field(default_factory=dict)  # by stream name
    replies: deque[Reply] = field(default_factory=lambda: deque(maxlen=64))
    calibrations: dict[tuple[int, int], StripCalibration] = field(default_factory=dict)
    # calibrations of force sensors
    forces: dict[tuple[int, int], ForceSensorCalibration] = field(default_factory=dict)
    stored_forces: StoredSetups = field(default_factory=dict)  # of strips that tell none
    marks: list[Event] = field(default_factory=list)  # events of the device, in order
    # nominal q_BS (4,) by tracked point, as the strips tell
    mounting: dict[str, Array] = field(default_factory=dict)
    # magnetometers on the trunk and magnet on the hand, as the glove declares
    plate: Plate | None = None
    replaced: int = 0  # times that another device was plugged in
    # by slot, ids of the strip that held it and of another that claimed it
    contested: dict[int, str] = field(default_factory=dict)
    undescribed: int = 0  # bursts dropped because their stream was never described
    # by the finger that a strip says it is for, the one that it is on
    exchanged: dict[str, str] = field(default_factory=dict)
    # base unit's clock to the host's arrival times, s
    host: ClockMap = field(default_factory=ClockMap)
    _announced: dict[int, Strip] = field(default_factory=dict)  # strips as they describe themselves
    _readings: dict[int, Reading] = field(default_factory=dict)  # by stream number
    _clocks: dict[int, ClockMap] = field(default_factory=dict)
    # base clock at recording time 0, ns; moves when the device begins again
    _zero: int | None = None
    _attribution: LossAttribution = field(default_factory=LossAttribution)
    _next_index: dict[int, int] = field(default_factory=dict)
    # frames missing when a stream's newest burst came
    _missing_at: dict[str, int] = field(default_factory=dict)
    _waiting: deque[tuple[Samples, float]] = field(default_factory=lambda: deque(maxlen=WAITING))
    # marks that came before the first sample
    _early: deque[Mark] = field(default_factory=lambda: deque(maxlen=64))
    _host_zero: float | None = None  # arrival time at recording time 0
    _newest: dict[str, float] = field(default_factory=dict)

    @property
    def counters(self) -> Counters:
        return self.decoder.counters

    @property
    def frame_losses(self) -> FrameLosses:
        """Frames that are missing, by where they were lost."""
        return self._attribution.losses(self.counters.lost)

    def feed(self, chunk: bytes, arrival: float) -> list[Block]:
        """Blocks completed by this chunk, at most one a stream; `arrival` is the host's clock in s."""
        return self.feed_all([(arrival, chunk)])

    def feed_all(
        self,
        chunks: Iterable[tuple[float, bytes]],
        failed: Callable[[Exception], object] | None = None,
    ) -> list[Block]:
        """Blocks completed by many (arrival, chunk), at most one a stream; the same samples as from one chunk after the other, sooner.

        A message that fails, by a fault of ours, is left out alone and passed to `failed`; without `failed` the error is raised.
        """
        bursts: dict[int, list[Burst]] = {}
        for arrival, chunk in chunks:
            for message in self.decoder.feed(chunk):
                try:
                    for burst in self._take(message, arrival):
                        # a stream described anew is another one
                        bursts.setdefault(id(burst.reading), []).append(burst)
                except Exception as fault:
                    if failed is None:
                        raise
                    failed(fault)
        return [
            block
            for parts in bursts.values()
            for block in self._blocks(parts, failed)
            if len(block.t)
        ]

    def _blocks(
        self, bursts: list[Burst], failed: Callable[[Exception], object] | None
    ) -> list[Block]:
        """The bursts of one stream as one block; where one fails each by itself, without those that do."""
        try:
            block, saturated = samples_of(bursts)
            if saturated:  # hardly ever
                self.counts[block.stream.name].saturated += saturated
            return [block]
        except Exception as fault:
            if failed is None:
                raise
            if len(bursts) > 1:
                return [block for burst in bursts for block in self._blocks([burst], failed)]
            failed(fault)
            return []

    @property
    def waiting(self) -> int:
        """Bursts kept until their stream is described."""
        return len(self._waiting)

    def recording_time(self, arrival: float) -> float | None:
        """The recording's time at a moment of the host's clock; None before the first sample."""
        if self._zero is None or self.host.offset is None:
            return None
        return self.host.remote(arrival) - self._zero * NS

    def exchange(self, worn_on: Mapping[str, str]) -> None:
        """Strips sit on other fingers than they say: {"index": "ring", "ring": "index"}; what is not named is as it says."""
        before = {number: stream.name for number, stream in self.streams.items()}
        self.exchanged = {finger: on for finger, on in worn_on.items() if finger != on}
        self.strips = {slot: self._worn(strip) for slot, strip in self._announced.items()}
        for strip in self.strips.values():
            self._mount(strip)
        self.streams.clear()
        self._rename()
        names = {
            name: self.streams[number].name
            for number, name in before.items()
            if number in self.streams
        }
        self.counts = {names.get(name, name): count for name, count in self.counts.items()}
        self._newest = {names.get(name, name): t for name, t in self._newest.items()}

    def _worn(self, strip: Strip) -> Strip:
        """The strip with the points of the finger that it is on."""
        on = {
            p: q
            for finger, other in self.exchanged.items()
            for p, q in zip(CHAINS[finger], CHAINS[other])
        }
        return replace(strip, points=tuple(on.get(p, p) for p in strip.points))

    def _mount(self, strip: Strip) -> None:
        turned = (
            np.reshape(strip.mounting, (-1, 4))
            if strip.mounting
            else np.tile(quat.IDENTITY, (len(strip.points), 1))
        )
        self.mounting |= dict(zip(strip.points, quat.normalize(turned)))

    def _take(self, message: Message, arrival: float) -> Iterable[Burst]:
        match message:
            case Identity():
                self._take_identity(message)
            case Strip():
                self._take_strip(message)
                return self._release_waiting()
            case StreamInfo():
                self._take_stream_info(message)
                return self._release_waiting()
            case Samples():
                return self._sampled(message, arrival)
            case Status():
                self.status = message
                self._attribution.update(message.overruns, self.counters.lost)
            case Reply():
                self.replies.append(message)
            case Pong():
                self.host.update(message.t * NS, arrival)
            case Mark():
                self._take_mark(message)
            case Plate():
                self.plate = message
            case StripCalibration() | ForceSensorCalibration():
                self._take_calibration(message)
                return self._release_waiting()
        return ()

    def _take_identity(self, identity: Identity) -> None:
        if self.identity is not None and identity.device_id != self.identity.device_id:
            self.replaced += 1
        if self.identity is not None and (identity.boot_id, identity.device_id) != (
            self.identity.boot_id,
            self.identity.device_id,
        ):
            self.undescribed += self.waiting
            self._waiting.clear()
            self._early.clear()
            self.strips, self.infos, self.streams, self._clocks, self.host = (
                {},
                {},
                {},
                {},
                ClockMap(),
            )
            self._announced, self.plate = {}, None
            self.calibrations, self.forces, self._readings = {}, {}, {}
            self._zero, self._next_index = None, {}
        self.identity = identity

    def _take_strip(self, announced: Strip) -> None:
        self._announced[announced.slot] = announced
        strip = self._worn(announced)
        before = self.strips.get(strip.slot)
        if before is not None and strip.attached and before.strip_id != strip.strip_id:
            self.contested[strip.slot] = f"{before.strip_id:x} and {strip.strip_id:x}"
        if not strip.attached or (
            before is not None and before.strip_id != strip.strip_id
        ):  # another strip has another flash
            self.calibrations = {
                key: c for key, c in self.calibrations.items() if key[0] != strip.slot
            }
            self.forces = {key: c for key, c in self.forces.items() if key[0] != strip.slot}
        if not strip.attached:
            self.strips.pop(strip.slot, None)
            self._announced.pop(strip.slot, None)
            gone = [n for n, info in self.infos.items() if info.slot == strip.slot]
            for number in gone:
                self.infos.pop(number), self.streams.pop(number, None)
        elif self.strips.get(strip.slot) != strip:
            self.strips[strip.slot] = strip
            self._mount(strip)
            self._rename()

    def _take_calibration(self, calibration: StripCalibration | ForceSensorCalibration) -> None:
        key = calibration.slot, calibration.sensor
        known: dict[tuple[int, int], Any] = (
            self.forces if isinstance(calibration, ForceSensorCalibration) else self.calibrations
        )
        if known.get(key) != calibration:
            known[key] = calibration
            self._rename()

    def _take_mark(self, mark: Mark) -> None:
        if self._zero is None:
            self._early.append(mark)
            return
        details = {
            key: _degrees(value) if key.endswith("_deg") else value
            for key, value in mark.details.items()
        }
        self.marks.append(
            Event((mark.t - self._zero) * NS, mark.duration * NS, mark.trial_type, details)
        )

    def _take_stream_info(self, info: StreamInfo) -> None:
        if self.infos.get(info.stream) != info:
            self.infos[info.stream] = info
            self._next_index.pop(info.stream, None)
            self._rename()

    def _release_waiting(self) -> Iterable[Burst]:
        """The bursts whose stream is described by now."""
        ready = [w for w in self._waiting if w[0].stream in self.streams]
        self._waiting = deque(
            (w for w in self._waiting if w[0].stream not in self.streams), maxlen=WAITING
        )
        for samples, arrival in ready:
            yield from self._sampled(samples, arrival)

    def _rename(self) -> None:
        """Stream descriptions of everything that is known from both its strip and its StreamInfo."""
        for number, info in self.infos.items():
            strip = self.strips.get(info.slot)
            messages = self._corrections_of(strip) if strip is not None else None
            if strip is None or messages is None:
                self.streams.pop(number, None)  # its bursts wait
                continue
            forces, applied = self._forces_of(strip, info)
            name = name_of(strip.points, info.quantities)
            if name in {s.name for n, s in self.streams.items() if n != number}:
                name += f"_slot{info.slot}"  # two strips for the same finger
            stream = describe_stream(name, strip.points, info, messages, forces, applied)
            if self.streams.get(number) != stream:
                self.streams[number] = stream
            before = self._readings.get(number)
            if before is None or not before.is_of(stream, info, messages, forces):
                self._readings[number] = make_reading(
                    self.streams[number], info, messages, forces, applied
                )

    def _corrections_of(self, strip: Strip) -> tuple[StripCalibration, ...] | None:
        """What corrects each sensor of a strip, empty where nothing is to be done; None until the strip has sent all of it."""
        if not (strip.raw and self.correct):
            return ()
        keys = [(strip.slot, k) for k in range(len(strip.points))]
        if not all(key in self.calibrations or key in self.forces for key in keys):
            return None
        messages = tuple(self.calibrations.get(key, StripCalibration(*key)) for key in keys)
        return () if all(correction_of(c).trivial for c in messages) else messages

    def _forces_of(
        self, strip: Strip, info: StreamInfo
    ) -> tuple[tuple[ForceSensorCalibration | None, ...], bool]:
        """What is known of each force sensor of a stream, empty where nothing is, and whether samples are still to be corrected by it."""
        announced = tuple(self.forces.get((strip.slot, k)) for k in range(len(strip.points)))
        stored = (
            ()
            if any(announced)
            else force_calibration.messages_of_setups(
                self.stored_forces.get(f"{strip.strip_id:x}", {}), strip.slot, strip.points
            )
        )
        found = announced if any(announced) else stored
        return (
            (found, self.correct and (strip.raw or found is stored))
            if FORCE in info.quantities and any(found)
            else ((), False)
        )

    def _sampled(self, samples: Samples, arrival: float) -> Iterable[Burst]:
        reading = (
            self._readings.get(samples.stream)
            if samples.stream in self.streams and samples.stream in self.infos
            else None
        )
        if reading is None:
            if len(self._waiting) == WAITING:
                self.undescribed += 1
            self._waiting.append((samples, arrival))
            return
        if not has_expected_size(samples, reading.info, len(reading.stream.sensors)):
            self.undescribed += 1
            return
        self.host.update(samples.t_sent * NS, arrival)
        name = reading.stream.name
        newest = self._newest.get(name, -np.inf)
        t = self._times(samples, reading.info, arrival)
        if reading.info.clock != 0 and samples.count and 0 <= newest - t[0] < SET_BACK:
            t = np.maximum(t, newest + 1e-6 * np.arange(1, samples.count + 1))
        stale = bisect_right(t, newest)  # a clock that jumped back must not make time run backwards
        self._count(name, samples, stale)
        if stale < samples.count:
            self._newest[name] = float(t[-1])
        yield Burst(reading, t, stale, samples)

    def _times(self, samples: Samples, info: StreamInfo, arrival: float) -> np.ndarray:
        own = samples.t_first
        if info.clock != 0:
            clock = self._clocks.setdefault(info.clock, ClockMap())
            clock.update(own * NS, samples.t_sent * NS)
        base = own * NS if info.clock == 0 else self._clocks[info.clock].local(own * NS)
        if self._zero is None:  # the first sample, or the first after the device began again
            self._host_zero = arrival if self._host_zero is None else self._host_zero
            self._zero = (own if info.clock == 0 else round(base / NS)) - round(
                (arrival - self._host_zero) / NS
            )
            while self._early:
                self._take_mark(self._early.popleft())
        first = (own - self._zero) * NS if info.clock == 0 else base - self._zero * NS
        return first + np.arange(samples.count) / info.rate

    def _count(self, name: str, samples: Samples, stale: int) -> None:
        count = self.counts.setdefault(name, StreamCount())
        expected = self._next_index.get(samples.stream)
        lost = (samples.index - expected) % 2**32 if expected is not None else 0
        lost = lost if lost < 2**31 else 0
        missing = self.counters.lost
        if lost and missing == self._missing_at.get(name, missing):
            count.unsent += lost
        self._missing_at[name] = missing
        count.lost += lost + stale
        count.samples += samples.count - stale
        self._next_index[samples.stream] = (samples.index + samples.count) % 2**32


def _degrees(value: str) -> float | str:
    try:
        return float(value)
    except ValueError:
        return value
