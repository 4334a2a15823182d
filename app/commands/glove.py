"""`handscope glove`: a virtual glove behind a pseudo-terminal or a TCP port; it speaks the wire protocol of a real one."""

import argparse
import json
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from handscope.app.commands.words import say, seed
from handscope.app.devices.virtual_glove import session, tcp
from handscope.app.devices.virtual_glove.faults import FaultParams, Faults
from handscope.app.devices.virtual_glove.firmware import Build, Firmware
from handscope.app.devices.virtual_glove.flash import Flash, factory_flash, require_fitting
from handscope.app.devices.virtual_glove.wearer import Playback, SimulatedPerson, Wearer, layout
from handscope.estimators.data.samples import GYR
from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import ForceSetup, parse_setups
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, HANDS, SEGMENTS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.messages.system import describe
from handscope.estimators.sensors import saturation
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.wire.messages import Format

ALL_STRIPS = (*FINGERS, "forearm")


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--pty",
        type=Path,
        metavar="PATH",
        help="where the port appears: a link to a pseudo-terminal",
    )
    where.add_argument(
        "--tcp",
        type=_address,
        metavar="HOST:PORT",
        help="listen there instead, on any system; port 0 takes a free one",
    )
    parser.add_argument("--hand", choices=HANDS, help="left, or the recording's")
    parser.add_argument(
        "--strips",
        default="all",
        metavar="NAMES",
        help=f"all, none, all with more, or some of {','.join(ALL_STRIPS)},force (force sensors on thumb and index tip),torque (they have six axes),trunk (an inertial sensor and magnetometers there, a magnet on the hand); the hand's base unit is always there",
    )
    parser.add_argument(
        "--rate",
        action="append",
        default=[],
        metavar="HZ",
        help="of all strips (100), or of one: index=500; may be repeated",
    )
    parser.add_argument(
        "--format",
        choices=("int16", "float32"),
        default=None,
        help="how samples travel (int16; float32 for --replay)",
    )
    parser.add_argument(
        "--wired",
        action="store_true",
        help="the forearm's sensor is on a cable as the others, not on a radio link with delays",
    )
    parser.add_argument("--seed", type=seed, default=0)
    parser.add_argument(
        "--force-setup",
        type=Path,
        metavar="FILE.json",
        help="what `calibrate-force` found: the force sensors send what they read, and the glove tells the calibration",
    )
    parser.add_argument(
        "--untold",
        action="store_true",
        help="with --force-setup: the glove keeps no calibration and tells none",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--task",
        metavar="T",
        help=f"what the built-in patient does over and over: {', '.join(task_performance.TASKS)}; without it, what it is told",
    )
    what.add_argument("--replay", type=Path, metavar="RECORDING", help="play any recording")
    parser.add_argument("--speed", type=float, default=1.0, help="of time, for --replay (1)")
    faults = parser.add_argument_group("faults")
    faults.add_argument(
        "--loss", type=_share, default=0.0, metavar="P", help="share of frames lost"
    )
    faults.add_argument(
        "--repeat", type=_share, default=0.0, metavar="P", help="share of frames sent twice"
    )
    faults.add_argument(
        "--corrupt",
        type=_share,
        default=0.0,
        metavar="P",
        help="share of frames with a flipped bit",
    )
    faults.add_argument(
        "--garbage",
        type=_share,
        default=0.0,
        metavar="P",
        help="share of frames followed by random bytes",
    )
    faults.add_argument(
        "--delay",
        type=float,
        default=0.0,
        metavar="S",
        help="hold everything back for S seconds every 3 s",
    )
    faults.add_argument(
        "--drift", type=float, default=0.0, metavar="PPM", help="drift of the glove's clock"
    )
    faults.add_argument(
        "--saturate", type=float, metavar="DEG/S", help="full scale of the gyroscopes"
    )
    faults.add_argument(
        "--exchange",
        nargs=2,
        choices=(*FINGERS, *SEGMENTS),
        metavar="FINGER",
        help="two strips are on each other's finger, or two sensors such as index_middle on each other's segment",
    )
    faults.add_argument(
        "--negate",
        action="append",
        default=[],
        metavar="SENSOR:AXIS",
        help="an axis of a sensor's gyroscope has the wrong sign, such as index_middle:z",
    )
    faults.add_argument(
        "--pull",
        action="append",
        default=[],
        metavar="STRIP@T",
        help="pull a strip T seconds after the start",
    )
    faults.add_argument(
        "--plug", action="append", default=[], metavar="STRIP@T", help="plug it in again"
    )
    faults.add_argument(
        "--unplug",
        action="append",
        default=[],
        metavar="T[:S]",
        help="pull the cable at T, for S seconds (for good)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    # so that the link is taken away
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    address, plug = _line(arguments)
    rng = np.random.default_rng(arguments.seed)
    wearer = _wearer(arguments, rng)
    kind = arguments.format or ("float32" if arguments.replay else "int16")
    build = Build(
        device_id=0x5C09E0 + arguments.seed,
        drift=arguments.drift * 1e-6,
        forearm_delay=(0.0, 0.0) if arguments.wired else Build.forearm_delay,
        format=Format.INT16 if kind == "int16" else Format.FLOAT32,
    )
    flash = (
        Flash()
        if arguments.replay
        else factory_flash(wearer.streams, np.random.default_rng([arguments.seed, 1]))
    )
    if arguments.force_setup:
        flash.forces, flash.tells_forces = (
            _forces(arguments.force_setup, wearer),
            not arguments.untold,
        )
    script = session.Script(_actions(arguments, [s.name for s in wearer.streams]))
    faults = Faults(
        FaultParams(
            **{n: getattr(arguments, n) for n in ("loss", "repeat", "corrupt", "garbage", "delay")}
        ),
        rng,
    )
    say(f"{wearer.hand} glove with {', '.join(s.name for s in wearer.streams)} at {address}")
    if _is_typed():
        say("type: pull STRIP, plug STRIP, unplug SECONDS, task NAME")
    powered = [0]

    def power_up() -> Firmware:
        powered[0] += 1
        if powered[0] > 1 and isinstance(wearer, SimulatedPerson):
            wearer.__post_init__()
        return Firmware(wearer, replace(build, boot_id=int(rng.integers(1, 2**31))), rng, flash)

    session.serve(plug, power_up, faults, script, arguments.speed, _typing(script))
    return 0


def _line(
    arguments: argparse.Namespace,
) -> tuple[str, Callable[[], AbstractContextManager[session.Line]]]:
    """Where the glove is found, and what plugs its cable in."""
    if arguments.tcp:
        listener = tcp.listen(*arguments.tcp)
        host, port = listener.getsockname()[:2]
        return f"socket://{host}:{port}", partial(tcp.plug, listener)
    try:
        from handscope.app.devices.virtual_glove import pseudo_terminal
    except ImportError:
        raise InputError("command.no_pseudo_terminals") from None
    pseudo_terminal.require_free(arguments.pty)
    return str(arguments.pty), partial(pseudo_terminal.plug, arguments.pty)


def _wearer(arguments: argparse.Namespace, rng: np.random.Generator) -> Wearer:
    if arguments.replay:
        recording = formats_recordings.load(arguments.replay, arguments.hand)
        return Playback(
            replace(recording, samples=saturation.declare_full_scales(recording.samples))
        )  # live then bridges what batch does
    hand: Hand = arguments.hand or "left"
    named = () if arguments.strips == "none" else tuple(arguments.strips.split(","))
    strips = (*ALL_STRIPS, *(n for n in named if n != "all")) if "all" in named else named
    common, single = _rates(arguments.rate)
    streams = tuple(
        replace(s, rate=single.get(s.name, common if s.inertial else s.rate))
        for s in layout(strips, common)
    )
    unknown = set(single) - {s.name for s in streams}
    if unknown:
        raise InputError("command.rate_of_unknown_strip", unknown=unknown.pop())
    errors = (
        SensorErrors() if arguments.saturate is None else SensorErrors(gyr_range=arguments.saturate)
    )
    limit = float(np.radians(errors.gyr_range))
    streams = tuple(
        replace(s, full_scale={**s.full_scale, GYR: limit}) if GYR in s.quantities else s
        for s in streams
    )
    person = SimulatedPerson(hand, sized(hand), streams, rng, errors)
    if arguments.exchange:
        one, other = arguments.exchange
        worn = {s.name for s in streams} | {n for s in streams for n in s.sensors}
        if missing := {one, other} - worn:
            raise InputError("command.exchange_of_unknown_strip", missing=missing.pop())
        person.worn_on = {
            segment: on
            for a, b in ((one, other), (other, one))
            for segment, on in zip(CHAINS.get(a, (a,)), CHAINS.get(b, (b,)))
        }
    for text in arguments.negate:
        sensor, _, axis = text.partition(":")
        if axis not in ("x", "y", "z") or sensor not in {n for s in streams for n in s.sensors}:
            raise InputError("command.negate_of_unknown_sensor", text=text)
        person.negated = {**person.negated, sensor: "xyz".index(axis)}
    if arguments.task is not None:
        if arguments.task not in task_performance.TASKS:
            raise InputError(
                "command.unknown_task", task=arguments.task, tasks=", ".join(task_performance.TASKS)
            )
        person.repeat = arguments.task
    return person


def _forces(path: Path, wearer: Wearer) -> dict[str, ForceSetup]:
    """By point, of the force sensors that are worn."""
    try:
        table = json.loads(path.read_text("utf-8"))["ForceSetup"]
        forces = parse_setups(table)
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from problem
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError("command.no_force_setup", name=path.name) from problem
    require_fitting(forces, wearer.streams)
    return forces


def _rates(words: list[str]) -> tuple[float, dict[str, float]]:
    common, single = 100.0, {}
    for word in words:
        name, equals, value = word.rpartition("=")
        try:
            rate = float(value)
        except ValueError:
            raise InputError("command.strip_rate_form", word=word) from None
        if not 1 <= rate <= 1000:
            raise InputError("command.strip_rate_outside", word=word)
        if equals:
            single[name] = rate
        else:
            common = rate
    return common, single


def _actions(arguments: argparse.Namespace, strips: Sequence[str]) -> list[session.Action]:
    actions = []
    for verb in ("pull", "plug"):
        for word in getattr(arguments, verb):
            name, at, t = word.partition("@")
            if not at:
                raise InputError("command.fault_form", verb=verb, word=word)
            if name not in strips:
                raise InputError(
                    "command.fault_of_unknown_strip", verb=verb, name=name, strips=", ".join(strips)
                )
            actions.append(session.Action(_seconds(t, f"--{verb}"), verb, name))
    for word in arguments.unplug:
        t, _, length = word.partition(":")
        actions.append(
            session.Action(
                _seconds(t, "--unplug"), "unplug", length and str(_seconds(length, "--unplug"))
            )
        )
    return actions


def _typing(script: session.Script) -> Callable[[], bool]:
    """Looks for typed lines whenever asked whether to stop; never stops of itself."""
    began = time.monotonic()
    watched = _is_typed()

    def look() -> bool:
        if watched and select.select([sys.stdin], [], [], 0)[0]:
            script.actions += session.typed([sys.stdin.readline()], time.monotonic() - began)
        return False

    return look


def _is_typed() -> bool:
    """Whether somebody may type lines; Windows cannot wait for them beside other work."""
    return sys.stdin is not None and sys.stdin.isatty() and sys.platform != "win32"


def _address(word: str) -> tuple[str, int]:
    host, colon, port = word.rpartition(":")
    if not colon or not port.isdecimal() or int(port) > 65535:
        raise argparse.ArgumentTypeError(f"{word!r} is not of the form HOST:PORT")
    return host or "127.0.0.1", int(port)


def _share(word: str) -> float:
    value = float(word)
    if not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"{word} is not between 0 and 1")
    return value


def _seconds(word: str, option: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise InputError("command.seconds_form", option=option, word=word) from None
