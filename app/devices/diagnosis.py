"""Whether a glove is well: what it says of itself against what it sends, from some seconds of recording.

In      a recording, the stated facts and counters of the glove that made it
Out     a Diagnosis: figures of every stream and sensor, and what is to be mended
Source  limits from data sheets of common sensors (see LIMITS); faults of single sensors by sensors/fault_detection
Limits  bias and noise need a second at rest; a clock's drift needs about a minute to be known to 100 ppm
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from handscope.app.devices.glove import Glove
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.sensors import fault_detection
from handscope.estimators.sensors.static_segments import Rest, RestParams, find_rests
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.protocol_warnings import deviations

RATE_SHARE = 0.02  # of the stated rate: oscillators of inertial sensors are within 1 to 2 % (LSM6DSV16X, BMI270 data sheets)
CLOCK_DRIFT = 2000.0  # ppm; crystals are within 100, resistor-capacitor clocks are not
# deg/s per root Hz: four times the BMI270's 0.007; LSM6DSV16X and ICM-42688-P have 0.003
GYR_NOISE = 0.03
ACC_NOISE = 0.6  # mg per root Hz: four times the BMI270's 0.16; the others have 0.06 to 0.07
GYR_BIAS = 3.0  # deg/s: three times the 1 of the LSM6DSV16X; BMI270 and ICM-42688-P have 0.5
ACC_OFFSET = 80.0  # mg that the size at rest is off gravity: four times the 20 of BMI270 and ICM-42688-P; the LSM6DSV16X has 12
SETTLED = 30.0  # s of recording before a clock's drift is judged, and the rate of a sensor with a clock of its own


@dataclass(frozen=True)
class StreamFigures:
    """One stream: what came of it."""

    name: str
    sensors: tuple[str, ...]
    stated_rate: float  # Hz
    measured_rate: float  # Hz by the base unit's clock, lost samples counted; NaN while a clock of its own is not known yet
    samples: int
    lost: int


@dataclass(frozen=True)
class SensorFigures:
    """One inertial sensor at rest; NaN where it was never at rest."""

    sensor: str
    gyr_bias: float  # deg/s, size
    gyr_noise: float  # deg/s per root Hz
    acc_size: float  # m/s^2
    acc_noise: float  # mg per root Hz


@dataclass(frozen=True)
class Diagnosis:
    """All that `handscope doctor` shows; passes where nothing is to be mended."""

    device: Mapping[str, object]
    streams: tuple[StreamFigures, ...]
    sensors: tuple[SensorFigures, ...]
    losses: Mapping[str, int]  # by where: glove, wire, host
    clock_ppm: float  # drift of the glove's clock against this machine's
    to_mend: tuple[str, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        return not self.to_mend


def diagnose(recording: LoadedRecording, glove: Glove) -> Diagnosis:
    """What the recording and the counters of its glove show."""
    a = glove.assembler
    blocks = [block for block in recording.samples.values() if len(block.t) > 1]
    unsettled = _own_clocks(a) if recording.duration < SETTLED else frozenset()
    streams = tuple(_stream_figures(block, recording, unsettled) for block in blocks)
    rests = {s: rest for block in blocks for s, rest in _rests(block)}
    sensors = tuple(_sensor_figures(s, rest, rate) for s, (rest, rate) in rests.items())
    losses = {
        "glove": a.frame_losses.glove,
        "wire": max(  # the first piece may be half a frame: it was on its way when we began
            a.frame_losses.wire + a.frame_losses.open, a.counters.corrupt - 1
        ),
        "host": glove.state.dropped,
    }
    clock = 1e6 * (a.host.rate - 1.0)
    faults = [
        *_losses_to_mend(losses, streams),
        *_rates_to_mend(streams),
        *_clock_to_mend(clock, recording.duration),
        *sensors_to_mend(sensors),
        *deviations(a),
        *(f.message for f in fault_detection.check(blocks, _common_rest(blocks, rests))),
    ]
    silent = sorted(s for block in blocks for s in block.stream.sensors if s not in rests)
    notes = (
        [f"{', '.join(silent)}: never at rest, bias and noise were not judged"] if silent else []
    )
    if unsettled:
        notes.append(
            f"{', '.join(sorted(unsettled))}: the rate is judged from {SETTLED:g} s on, because these sensors have a clock of their own"
        )
    return Diagnosis(
        _device(a), streams, sensors, losses, clock, tuple(faults), (*notes, *_absent(a))
    )


def _device(a: Assembler) -> dict[str, object]:
    if a.identity is None:
        return {}
    status = a.status
    return {
        "name": a.identity.name,
        "firmware": a.identity.firmware,
        "id": f"{a.identity.device_id:x}",
        "hand": a.identity.hand,
        "strips": {f"{slot}": list(strip.points) for slot, strip in sorted(a.strips.items())},
        "battery_percent": status.battery_percent
        if status and status.battery_percent <= 100
        else None,
        "temperature": round(status.temperature, 1) if status else None,
    }


def _stream_figures(
    block: Block, recording: LoadedRecording, unsettled: frozenset[str]
) -> StreamFigures:
    lost, span = recording.losses.get(block.stream.name, 0), block.t[-1] - block.t[0]
    is_known = span > 0 and block.stream.name not in unsettled
    return StreamFigures(
        block.stream.name,
        tuple(block.stream.sensors),
        float(block.stream.rate),
        float((len(block.t) - 1 + lost) / span) if is_known else float("nan"),
        len(block.t),
        lost,
    )


def _rests(block: Block) -> Iterator[tuple[str, tuple[Rest, float]]]:
    """The longest rest of each inertial sensor, and its stream's rate."""
    if not {GYR, ACC} <= set(block.stream.quantities):
        return
    for k, sensor in enumerate(block.stream.sensors):
        gyr, acc = block.of(GYR)[:, k], block.of(ACC)[:, k]
        whole = np.isfinite(gyr).all(axis=1) & np.isfinite(acc).all(axis=1)
        if whole.sum() < 2:
            continue
        found = find_rests(RestParams(), block.t[whole], gyr[whole], acc[whole])
        if found:
            yield sensor, (max(found, key=len), block.stream.rate)


def _sensor_figures(sensor: str, rest: Rest, rate: float) -> SensorFigures:
    root = np.sqrt(rate / 2)  # white noise fills half the sampling rate
    return SensorFigures(
        sensor,
        float(np.degrees(np.linalg.norm(rest.gyr))),
        float(np.degrees(rest.gyr_noise) / root),
        float(np.linalg.norm(rest.acc)),
        float(1e3 * rest.acc_noise / GRAVITY / root),
    )


def _common_rest(
    blocks: list[Block], rests: Mapping[str, tuple[Rest, float]]
) -> tuple[float, float]:
    """The stretch in which all sensors that rested did so; empty where there is none."""
    times = {s: block.t for block in blocks for s in block.stream.sensors}
    spans = [(times[s][r.first], times[s][r.last - 1]) for s, (r, _) in rests.items()]
    begin, end = max((b for b, _ in spans), default=0.0), min((e for _, e in spans), default=0.0)
    return (float(begin), float(end)) if end > begin else (0.0, 0.0)


def _losses_to_mend(losses: Mapping[str, int], streams: tuple[StreamFigures, ...]) -> Iterator[str]:
    if losses["glove"]:
        yield phrase("doctor.glove_lost", count=losses["glove"])
    if losses["wire"]:
        yield phrase("doctor.wire_lost", count=losses["wire"])
    if losses["host"]:
        yield phrase("doctor.host_late", count=losses["host"])
    for s in streams:
        if s.lost:
            yield phrase(
                "doctor.samples_missing", name=s.name, lost=s.lost, samples=s.samples + s.lost
            )


def _own_clocks(a: Assembler) -> frozenset[str]:
    """Streams of sensors with a clock of their own, whose relation to the base's takes time to find."""
    return frozenset(
        s.name for number, s in a.streams.items() if number in a.infos and a.infos[number].clock
    )


def _rates_to_mend(streams: tuple[StreamFigures, ...]) -> Iterator[str]:
    for s in streams:
        if abs(s.measured_rate / s.stated_rate - 1) > RATE_SHARE:
            yield phrase("doctor.rate", name=s.name, measured=s.measured_rate, stated=s.stated_rate)


def _clock_to_mend(ppm: float, duration: float) -> Iterator[str]:
    if duration >= SETTLED and abs(ppm) > CLOCK_DRIFT:
        yield phrase("doctor.clock", ppm=ppm)


def sensors_to_mend(sensors: Iterable[SensorFigures]) -> Iterator[str]:
    """A sentence for each figure that is beyond what data sheets allow."""
    for s in sensors:
        if s.gyr_noise > GYR_NOISE:
            yield phrase("doctor.gyr_noise", sensor=s.sensor, noise=s.gyr_noise, limit=GYR_NOISE)
        if s.gyr_bias > GYR_BIAS:
            yield phrase("doctor.gyr_bias", sensor=s.sensor, bias=s.gyr_bias, limit=GYR_BIAS)
        if (off := 1e3 * abs(s.acc_size / GRAVITY - 1)) > ACC_OFFSET:
            yield phrase("doctor.acc_offset", sensor=s.sensor, offset=off, limit=ACC_OFFSET)
        if s.acc_noise > ACC_NOISE:
            yield phrase("doctor.acc_noise", sensor=s.sensor, noise=s.acc_noise, limit=ACC_NOISE)


def _absent(a: Assembler) -> Iterator[str]:
    worn = {point for strip in a.strips.values() for point in strip.points}
    if "hand" not in worn:
        yield phrase("doctor.no_hand_sensor")
    if "forearm" not in worn:
        yield phrase("doctor.no_forearm_sensor")
