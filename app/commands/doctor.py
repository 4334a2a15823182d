"""`handscope doctor`: who is at a port, and is it well? Ends in pass (exit code 0) or in what to mend (1); 2 where there is no glove."""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from handscope.app.commands.record import connect
from handscope.app.commands.words import progress_bar, require_file, say
from handscope.app.devices.diagnosis import Diagnosis, diagnose
from handscope.app.devices.glove import Glove
from handscope.app.devices.taps import PLACES, TAP, ShakenSensors
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import codes_of, phrase
from handscope.sessions.formats import recordings as formats_recordings

TAP_WAIT = 10.0  # s that a tap is waited for
BETWEEN = 0.5  # s after the request in which taps do not count
TAPPING = 1.0  # s from the first tap until the hardest is taken


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("port", help="serial port or address, as `handscope record` has it")
    parser.add_argument(
        "--seconds", type=float, default=10.0, metavar="S", help="how long to listen (10)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    parser.add_argument(
        "--no-taps",
        action="store_true",
        help="do not ask for a tap on each finger, hand and forearm",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if not 1 <= arguments.seconds <= 3600:
        raise InputError("command.seconds_outside", seconds=arguments.seconds)
    if arguments.json:
        require_file(arguments.json)
    shaken, felt = ShakenSensors(), dict[str, str]()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "doctor.mcap"
        with Glove(arguments.port, out, {"port": arguments.port}, shaken.take) as glove:
            connect(glove, arguments.port)
            say("Lay the glove down, or hold the hand still.")
            _wait(arguments.seconds)
            asks = not arguments.no_taps and sys.stdin is not None and sys.stdin.isatty()
            wrong = list(_ask_for_taps(glove, shaken, felt)) if asks else []
        diagnosis = diagnose(formats_recordings.load(out, "left"), glove)
    for line in _lines(diagnosis, wrong):
        say(line)
    to_mend = (*diagnosis.to_mend, *wrong)
    if arguments.json:
        arguments.json.write_text(_json(arguments.port, diagnosis, to_mend, felt))
    return 1 if to_mend else 0


def _wait(seconds: float) -> None:
    hear, close = progress_bar("listening")
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        hear(1 - left / seconds)
        time.sleep(min(0.1, left))
    close()


def _lines(d: Diagnosis, wrong: list[str]) -> Iterator[str]:
    device = d.device
    yield f"{device.get('name', 'a glove')}, firmware {device.get('firmware', '?')}, {device.get('hand') or 'unknown'} hand, id {device.get('id', '?')}"
    yield (
        f"battery {device['battery_percent']} %"
        if device.get("battery_percent") is not None
        else "on USB power"
    )
    for s in d.streams:
        measured = f" at {s.measured_rate:.2f} Hz" if np.isfinite(s.measured_rate) else ""
        yield f"  {s.name}: {s.samples} samples{measured} (states {s.stated_rate:g} Hz), {s.lost} lost"
    yield "  at rest                gyroscope: bias, noise           accelerometer: size, noise"
    for f in d.sensors:
        yield f"  {f.sensor:20s} {f.gyr_bias:8.2f} deg/s {f.gyr_noise:7.4f} deg/s/rtHz {f.acc_size:7.2f} m/s^2 {f.acc_noise:6.3f} mg/rtHz"
    yield f"lost by the glove {d.losses['glove']}, on the wire {d.losses['wire']}, by this machine {d.losses['host']}; its clock runs {d.clock_ppm:+.0f} ppm off ours"
    yield from (f"note: {note}" for note in d.notes)
    yield from (f"to mend: {fault}" for fault in (*d.to_mend, *wrong))
    if not d.to_mend and not wrong:
        yield "pass: nothing to mend"


def _json(port: str, d: Diagnosis, to_mend: tuple[str, ...], felt: dict[str, str]) -> str:
    table = {
        "port": port,
        "passed": not to_mend,
        **asdict(d),
        "taps": felt,
        "to_mend": list(to_mend),
        "codes": [sorted(codes_of(fault)) for fault in to_mend],
    }
    return json.dumps(_finite(table), indent=1) + "\n"


def _finite(value: object) -> object:
    """NaN is no JSON: null in its place."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _ask_for_taps(glove: Glove, shaken: ShakenSensors, felt: dict[str, str]) -> Iterator[str]:
    """A tap on each place that has a sensor: notes which sensor felt it, gives a sentence for each that another felt most."""
    for place in shaken.places():
        sentence, sensors = PLACES[place]
        say(sentence)
        glove.wait_for(lambda _: False, BETWEEN)  # the last tap of the place before
        shaken.forget()
        glove.wait_for(lambda _: shaken.hardest()[1] > TAP, TAP_WAIT)
        _wait(TAPPING)
        sensor, step = shaken.hardest()
        if step < TAP:
            yield phrase("doctor.no_tap", place=place, seconds=TAP_WAIT)
            continue
        felt[place] = sensor
        if sensor in sensors:
            say(f"  {sensor} felt it")
        else:
            yield phrase("doctor.tap_elsewhere", place=place, sensor=sensor)
