"""Open a Motion-BIDS recording, a folder or a zip of it, by the rules of docs/motion-bids.md."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import plate_from
from handscope.estimators.data.samples import (
    ACC,
    FASTEST_RATE,
    FORCE,
    GYR,
    MAG,
    TORQUE,
    TRACKED_POINTS,
    Block,
    Stream,
)
from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import ForceSetup, parse_setups
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.messages import Message, render_english
from handscope.estimators.numerics.typing import Array
from handscope.sessions.files.recording import LoadedRecording, require_samples
from handscope.sessions.motion_bids import raw_forces, scans
from handscope.sessions.motion_bids.events_reader import events_of
from handscope.sessions.motion_bids.files import Files, open_files, whole, with_checksum
from handscope.sessions.motion_bids.orientation_channels import (
    orientation_block,
    orientation_columns,
)
from handscope.sessions.motion_bids.tables import MISSING, json_object, numbers, rows

TYPES = {"GYRO": GYR, "ACCEL": ACC, "MAGN": MAG, "MISC": FORCE}
UNITS: dict[str, dict[str, float]] = {
    "GYRO": {"rad/s": 1.0, "deg/s": np.pi / 180, "°/s": np.pi / 180},
    "ACCEL": {"m/s^2": 1.0, "m/s²": 1.0},
    "MAGN": {
        "T": 1.0,
        "uT": 1e-6,
        "µT": 1e-6,
        "μT": 1e-6,
        "mT": 1e-3,
        "nT": 1e-9,
        "G": 1e-4,
        "mG": 1e-7,
    },
    "MISC": {"N": 1.0},
    "LATENCY": {"s": 1.0},
}
SLOWEST = 1.5  # Hz: magnetometers may give two samples a second, times in ms look like one at most
TORQUES = {  # units of the torques of a force sensor with six axes; forces and torques are MISC
    **dict.fromkeys(("N*m", "N·m", "N⋅m", "N m", "Nm"), 1.0),
    **dict.fromkeys(
        ("N*mm", "N·mm", "N⋅mm", "N mm", "Nmm", "mN*m", "mN·m", "mN⋅m", "mN m", "mNm"), 1e-3
    ),
}
RATE_TOLERANCE = (
    0.02  # largest deviation of the declared rate from that of the time stamps without a warning
)
SAME_RATE = 1e-3  # below this the declared rate is used: 0.1 deg in a movement of 90
NAME = re.compile(
    r"(?P<stem>sub-[^_/]+(?:_ses-[^_/]+)?_task-[^_/]+)_tracksys-(?P<system>[^_/]+)(?P<rest>(?:_[a-z]+-[^_/]+)*)_motion\.tsv$"
)


@dataclass(frozen=True)
class System:
    """One tracking system of a recording: its files and what the sidecar says."""

    name: str
    path: str
    sidecar: dict[str, Any]
    channels: list[dict[str, str]]


def load(path: Path, hand: Hand | None = None, inertial: bool = True) -> LoadedRecording:
    """Open the recording at `path`; `hand` is the side to take where the recording does not say (and contradicts where it says another).

    With `inertial` false neither inertial samples nor a side are asked for: magnetometers alone are a recording too.
    """
    inside, chosen = _choose(path)
    files, checksum = with_checksum(chosen)
    systems = _systems(files, inside)
    unsaid = all(s.sidecar.get("MeasuredHand") in (None, MISSING) for s in systems)
    side = _hand(
        [s.sidecar for s in systems], HANDS[0] if unsaid and not inertial else hand, path.name
    )
    warnings: list[str] = []
    setups = parse_setups(_merge_sidecars(systems, "ForceSetup"))
    samples = {}
    calibrated: set[str] = set()
    for system in systems:
        raw = raw_forces.raw_columns(system.name, system.channels, setups)
        calibrated |= raw.keys()
        for block in _blocks(system, files, warnings, setups, raw):
            samples[block.stream.name] = block
    raw_forces.require_all(setups, calibrated)
    _refuse_double(samples)
    start_utc = scans.start_of(files, [s.path for s in systems], warnings)
    recording = LoadedRecording(
        side,
        sized(side, measures_from(_merge_sidecars(systems, "HandGeometry"))),
        _mounting(_merge_sidecars(systems, "SensorMounting")),
        samples,
        events_of(files, inside),
        tuple(warnings),
        start_utc=start_utc,
        checksum=checksum(),
        source={"format": "Motion-BIDS", "recording": inside, **_provenance(systems)},
        plate=plate_from(_merge_sidecars(systems, "MagnetSetup")),
    )
    return require_samples(recording, path.name) if inertial else recording


def recordings_in(files: Files) -> list[str]:
    """The recordings of a dataset: paths without `_tracksys-...`."""
    raw = [
        path
        for path in files
        if not path.startswith("derivatives/")
        and "_desc-" not in path
        and PurePosixPath(path).parent.name == "motion"
    ]
    found = [(path, NAME.search(path)) for path in raw]
    return sorted(
        {str(PurePosixPath(path).parent / (m["stem"] + m["rest"])) for path, m in found if m}
    )


def _choose(path: Path) -> tuple[str, Files]:
    """The one recording meant: the only one of a folder or zip, or the one that a path to its motion.tsv names."""
    if path.is_file() and path.name.endswith("_motion.tsv"):
        path = path.absolute()
        root = next((p.parent for p in path.parents if p.name.startswith("sub-")), path.parent)
        files = open_files(root)
        m = NAME.search(path.name)
        wanted = (
            str(PurePosixPath(path.relative_to(root).parent.as_posix()) / (m["stem"] + m["rest"]))
            if m
            else path.name
        )
    else:
        files, wanted = open_files(path), ""
    found = recordings_in(files)
    if wanted:
        found = [f for f in found if f == wanted]
    if not found:
        raise InputError(
            "motion_bids.no_recording",
            name=path.name,
            pattern="sub-*/[ses-*/]motion/sub-*_task-*_tracksys-*_motion.tsv",
        )
    if len(found) > 1:
        shown = [PurePosixPath(f).name for f in found[:4]] + ["..."] * (len(found) > 4)
        raise InputError(
            "motion_bids.several_recordings",
            name=path.name,
            count=len(found),
            names=", ".join(shown),
        )
    belongs = found[0].split("/motion/")[0]
    return found[0], {
        name: read
        for name, read in files.items()
        if name.startswith(f"{belongs}/") or "/" not in name
    }


def _systems(files: Files, inside: str) -> list[System]:
    folder, stem = PurePosixPath(inside).parent, PurePosixPath(inside).name
    systems = []
    for path in sorted(files):
        m = NAME.search(path)
        if not m or PurePosixPath(path).parent != folder or m["stem"] + m["rest"] != stem:
            continue
        if "_desc-" in m["rest"]:
            continue  # a derivative beside the raw data
        base = path.removesuffix("_motion.tsv")
        for beside in (f"{base}_motion.json", f"{base}_channels.tsv"):
            if beside not in files:
                raise InputError(
                    "motion_bids.file_missing_beside",
                    file=PurePosixPath(beside).name,
                    name=PurePosixPath(path).name,
                )
        needed = ("name", "component", "type", "tracked_point", "units")
        channels = list(
            rows(
                whole(files[f"{base}_channels.tsv"]),
                PurePosixPath(base).name + "_channels.tsv",
                needed,
            ).values()
        )
        systems.append(
            System(
                m["system"],
                path,
                json_object(
                    whole(files[f"{base}_motion.json"]), PurePosixPath(base).name + "_motion.json"
                ),
                channels,
            )
        )
    return systems


def _hand(sidecars: list[dict[str, Any]], wanted: Hand | None, name: str) -> Hand:
    sides = {
        str(s["MeasuredHand"]).lower()
        for s in sidecars
        if s.get("MeasuredHand") not in (None, MISSING)
    }
    if not sides <= set(HANDS):
        raise InputError("motion_bids.unknown_hand", name=name, value=sorted(sides - set(HANDS))[0])
    if len(sides) > 1:
        raise InputError("motion_bids.two_hands", name=name)
    if wanted and sides and wanted not in sides:
        raise InputError("motion_bids.other_hand", name=name, one=sides.pop(), other=wanted)
    for hand in HANDS:
        if hand in sides or (not sides and wanted == hand):
            return hand
    raise InputError("motion_bids.hand_not_given", name=name)


def _blocks(
    system: System,
    files: Files,
    warnings: list[str],
    setups: Mapping[str, ForceSetup],
    raw: Mapping[str, list[int]],
) -> Iterator[Block]:
    """The samples of a tracking system, its orientations as a stream of their own. `raw`: columns of the force sensors that are calibrated here."""
    name = PurePosixPath(system.path).name
    wanted = _columns(system, warnings, raw)
    oriented = orientation_columns(system.name, system.channels)
    if not wanted and not raw and not oriented:
        return
    table = numbers(files[system.path](), name, len(system.channels))
    if not len(table):
        raise InputError("motion_bids.no_samples", name=name)
    t, rate = times_of(system, table, name, warnings)
    if oriented:
        label = f"{system.name}_orientation" if wanted or raw else system.name
        yield orientation_block(label, oriented, t, table, rate)
    if wanted or raw:
        yield _block(system, table, wanted, setups, raw, t, rate)


def _block(
    system: System,
    table: Array,
    wanted: Mapping[tuple[str, str, int], tuple[int, float]],
    setups: Mapping[str, ForceSetup],
    raw: Mapping[str, list[int]],
    t: Array,
    rate: float,
) -> Block:
    """What a tracking system measures with three axes."""
    kinds = {kind for _, kind, _ in wanted} | {
        kind for point in raw for kind in (FORCE, TORQUE)[: setups[point].axes // 3]
    }
    points = [p for p in TRACKED_POINTS if p in raw or any(point == p for point, _, _ in wanted)]
    quantities = [q for q in (GYR, ACC, MAG, FORCE, TORQUE) if q in kinds]
    values = np.full((len(table), len(points), 3 * len(quantities)), np.nan)
    for (point, kind, component), (column, factor) in wanted.items():
        values[:, points.index(point), 3 * quantities.index(kind) + component] = (
            table[:, column] * factor
        )
    for point, columns in raw.items():
        first, loads = (
            3 * quantities.index(FORCE),
            raw_forces.loads_of(setups[point], table[:, columns]),
        )
        values[:, points.index(point), first : first + loads.shape[1]] = loads
    known = {p: setups[p].scale_sd for p in points if p in setups}
    turned = {p: sd for p in known if (sd := setups[p].turn_sd) is not None}
    return Block(
        Stream(
            system.name,
            tuple(points),
            tuple(quantities),
            rate,
            system.name,
            scale_sd=known,
            turn_sd=turned,
        ),
        t,
        values,
    )


def _columns(
    system: System, warnings: list[str], raw: Mapping[str, list[int]]
) -> dict[tuple[str, str, int], tuple[int, float]]:
    """Which column holds which component of which quantity of which point, with the factor to SI; without points that have calibrated `raw` channels."""
    found: dict[tuple[str, str, int], tuple[int, float]] = {}
    strange: set[str] = set()
    torques: dict[str, list[tuple[str, int, float]]] = {}  # by point: component, column, factor
    for column, channel in enumerate(system.channels):
        kind, point = channel["type"].upper(), channel["tracked_point"]
        if kind not in TYPES or (kind == "MISC" and not point.endswith("_force")) or point in raw:
            continue
        _refuse_two_hands(point, system)
        if point not in TRACKED_POINTS:
            strange.add(point)
            continue
        if kind == "MISC" and channel["units"] in TORQUES:
            torques.setdefault(point, []).append(
                (channel["component"].lower(), column, TORQUES[channel["units"]])
            )
            continue
        component = (
            "xyz".find(channel["component"].lower()) if len(channel["component"]) == 1 else -1
        )
        if component < 0:
            raise InputError(
                "motion_bids.channel_component",
                system=system.name,
                channel=channel["name"],
                component=channel["component"],
            )
        key, factor = (point, TYPES[kind], component), _factor(system, channel, kind)
        if key in found:
            raise InputError(
                "motion_bids.channel_twice",
                system=system.name,
                point=point,
                kind=kind,
                component=channel["component"],
            )
        found[key] = (column, factor)
    for point, kind, _ in list(found):
        if any((point, kind, c) not in found for c in range(3)):
            raise InputError(
                "motion_bids.channel_components_missing", system=system.name, point=point, kind=kind
            )
    if strange:
        warnings.append(
            render_english(
                Message(
                    "motion_bids.unknown_points",
                    {"system": system.name, "points": ", ".join(sorted(strange))},
                )
            )
        )
    return found | _torques(system, torques, warnings)


def _torques(
    system: System, declared: Mapping[str, list[tuple[str, int, float]]], warnings: list[str]
) -> dict[tuple[str, str, int], tuple[int, float]]:
    """The torques of the points that tell all three: a sensor with four axes has one alone, and its forces are read without it."""
    partly = [
        point
        for point, channels in declared.items()
        if sorted(c for c, _, _ in channels) != ["x", "y", "z"]
    ]
    if partly:
        warnings.append(
            render_english(
                Message(
                    "motion_bids.torques_incomplete",
                    {"system": system.name, "points": ", ".join(sorted(partly))},
                )
            )
        )
    return {
        (point, TORQUE, "xyz".index(c)): (column, factor)
        for point, channels in declared.items()
        if point not in partly
        for c, column, factor in channels
    }


def _refuse_two_hands(point: str, system: System) -> None:
    sides = {
        side
        for side in HANDS
        for c in system.channels
        if side in c["tracked_point"].lower().split("_")
        and not c["tracked_point"].startswith("trunk")
    }
    if len(sides) > 1:
        raise InputError("motion_bids.two_hands_in_channels", system=system.name, point=point)


def _factor(system: System, channel: dict[str, str], kind: str) -> float:
    known = UNITS[kind]
    if channel["units"] not in known:
        if kind == "MISC":
            raise InputError(
                "motion_bids.not_a_force_unit",
                system=system.name,
                channel=channel["name"],
                unit=channel["units"],
            )
        shown = list(known)[:2]
        raise InputError(
            "motion_bids.unknown_unit",
            system=system.name,
            channel=channel["name"],
            unit=channel["units"],
            kind=kind,
            units=" or ".join(shown),
        )
    return known[channel["units"]]


def times_of(system: System, table: Array, name: str, warnings: list[str]) -> tuple[Array, float]:
    """Time stamps (n,) and rate: LATENCY where there is one, else the declared sampling frequency."""
    declared = system.sidecar.get("SamplingFrequency")
    rate = (
        float(declared) if isinstance(declared, (int, float)) and 0 < declared <= 100_000 else None
    )
    latency = [k for k, c in enumerate(system.channels) if c["type"].upper() == "LATENCY"]
    if not latency:
        if rate is None:
            raise InputError("motion_bids.no_time", system=system.name)
        return np.arange(len(table)) / rate, rate
    t = table[:, latency[0]] * _factor(system, system.channels[latency[0]], "LATENCY")
    backwards = np.flatnonzero(~(np.diff(t) > 0))
    if not np.isfinite(t[0]) or len(backwards):
        raise InputError(
            "motion_bids.time_not_increasing",
            name=name,
            line=int(backwards[0]) + 2 if len(backwards) else 1,
        )
    seen = _rate_seen(t) if len(t) > 1 else rate or 100.0
    if not SLOWEST <= seen <= FASTEST_RATE:
        raise InputError("motion_bids.rate_implausible", name=name, rate=seen)
    if rate is not None and abs(seen / rate - 1) > RATE_TOLERANCE:
        warnings.append(
            render_english(
                Message(
                    "motion_bids.rate_differs", {"system": system.name, "rate": rate, "seen": seen}
                )
            )
        )
    return t, rate if rate is not None and abs(seen / rate - 1) < SAME_RATE else seen


def _rate_seen(t: Array) -> float:
    """Samples a second from the first to the last, lost ones counted; time stamps may be rounded to a part of their distance."""
    steps = np.diff(t)
    period = np.median(steps)
    for _ in range(
        2
    ):  # the median of rounded steps is off: what it makes of them all together is not
        period = (t[-1] - t[0]) / np.maximum(np.rint(steps / period), 1).sum()
    return float(1 / period)


def _refuse_double(samples: Mapping[str, Block]) -> None:
    """A point's quantity may go on in another tracking system (its rate was changed), but not be in two at once."""
    seen: dict[tuple[str, str], str] = {}
    for name, block in samples.items():
        for quantity in block.stream.quantities:
            for k, point in enumerate(block.stream.sensors):
                if np.isnan(block.of(quantity)[:, k]).all():
                    continue
                other = seen.setdefault((point, quantity), name)
                if (
                    other != name
                    and block.t[0] <= samples[other].t[-1]
                    and samples[other].t[0] <= block.t[-1]
                ):
                    raise InputError(
                        "motion_bids.point_in_two_systems",
                        point=point,
                        quantity=quantity,
                        one=f"tracksys-{other}",
                        other=f"tracksys-{name}",
                    )


def _merge_sidecars(systems: list[System], entry: str) -> dict[str, Any]:
    """An object that any of the sidecars may hold; where several do, they must agree."""
    total: dict[str, Any] = {}
    for system in systems:
        value = system.sidecar.get(entry)
        if value is None:
            continue
        if not isinstance(value, dict):
            raise InputError("motion_bids.entry_not_an_object", system=system.name, entry=entry)
        for key, item in value.items():
            if key in total and total[key] != item:
                raise InputError("motion_bids.entries_differ", entry=entry, key=key)
            total[key] = item
    return total


def _mounting(table: Mapping[str, Any]) -> dict[str, Array]:
    mounting = {}
    for point, value in table.items():
        q = (
            np.asarray(value, dtype=float)
            if isinstance(value, list) and all(isinstance(x, (int, float)) for x in value)
            else np.empty(0)
        )
        if q.shape != (4,) or not 0.99 < np.linalg.norm(q) < 1.01:
            raise InputError("motion_bids.mounting_not_unit", point=point, value=str(value))
        mounting[point] = q / np.linalg.norm(q)
    return mounting


def _provenance(systems: list[System]) -> dict[str, Any]:
    wanted = {
        "Manufacturer": "manufacturer",
        "ManufacturersModelName": "device",
        "DeviceSerialNumber": "device_id",
        "SoftwareVersions": "software",
        "TaskName": "task",
    }
    source = {
        ours: s.sidecar[theirs]
        for s in systems
        for theirs, ours in wanted.items()
        if s.sidecar.get(theirs) not in (None, MISSING)
    }
    names = [
        s.sidecar["TrackingSystemName"]
        for s in systems
        if s.sidecar.get("TrackingSystemName") not in (None, MISSING)
    ]
    # of several none is the device's
    return {**({"device": names[0]} if len(names) == 1 else {}), **source}
