"""What is fuzzed: a function of bytes that may refuse them in words (InputError), and good input to begin from.

Anything else that it raises is a finding; so is what takes longer than HANG or writes a file outside its folder.
MATLAB's files are not among them: SciPy's reader ends its process where one is damaged, so a process of its own reads them
(tests/security/test_v15_isolation.py).
"""

import io
import json
import signal
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from cobs import cobs

from handscope.app import protocols
from handscope.app.devices.sources.lsl import marker_event
from handscope.app.devices.sources.slimevr.packets import CutShortError, packets_of
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.pipeline.landmark_trajectory import trajectory_of
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.formats.c3d import read_markers
from handscope.sessions.formats.landmarks import read_landmarks
from handscope.sessions.formats.qualisys import BACK, ELBOWS
from handscope.sessions.formats.qualisys import read_markers as read_table
from handscope.sessions.motion_bids.orientation_channels import orientation_columns
from handscope.sessions.store import backup
from handscope.sessions.store.store import open_store
from handscope.sessions.table_import.column_map import read_map
from handscope.sessions.table_import.guess import guess_map
from handscope.sessions.table_import.importing import check_table, import_table, read_once
from handscope.sessions.table_import.preview import preview
from handscope.sessions.wire.assembly import Assembler
from tests.app.devices.sources import slime_trackers as slime
from tests.bids import dataset
from tests.fuzz import binary_tables, web_input
from tests.glove import frames, whole_session
from tests.simulated import cut, in_strips

HANG = 20  # s on a busy machine
WRITES = 0o3  # flags of os.open that write: O_WRONLY, O_RDWR


@dataclass(frozen=True)
class Target:
    read: Callable[[bytes, Path], object]  # the bytes, and a folder that it may write to
    seeds: Callable[[], list[bytes]]
    refuses: bool = True  # whether it may say InputError at all


def wire(data: bytes, folder: Path) -> None:
    """Bytes of a port, in three chunks."""
    assembler = Assembler()
    for k, chunk in enumerate(
        (data[: len(data) // 3], data[len(data) // 3 : len(data) // 2], data[len(data) // 2 :])
    ):
        for block in assembler.feed(chunk, 10.0 + k):
            assert len(block.t) and block.values.shape[0] == len(block.t)


def payloads(data: bytes, folder: Path) -> None:
    """Frames whose checksum is right and whose content is anything: the first byte of a piece says how long it is."""
    sent, k, number = b"", 0, 0
    while k < len(data):
        piece, k, number = data[k + 1 : k + 1 + data[k]], k + 1 + data[k], number + 1
        body = number.to_bytes(2, "little") + piece
        sent += cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")) + b"\0"
    wire(sent, folder)


def recording(data: bytes, folder: Path) -> None:
    (folder / "r.mcap").write_bytes(data)
    formats_recordings.load(folder / "r.mcap", "left")


def bids(data: bytes, folder: Path) -> None:
    """A zip as it is uploaded."""
    (folder / "r.zip").write_bytes(data)
    formats_recordings.load(folder / "r.zip", "left")


def bids_files(data: bytes, folder: Path) -> None:
    """A good zip around files that are anything: name, 0, content, 1 0 1, name ..."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        names = set()
        for part in data.split(b"\1\0\1"):
            name, _, content = part.partition(b"\0")
            if (name_ := name.decode("utf-8", "replace")[:200]) and name_ not in names:
                names.add(name_)
                archive.writestr(zipfile.ZipInfo(name_), content)
    bids(made.getvalue(), folder)


def markers(data: bytes, folder: Path) -> None:
    (folder / "m.c3d").write_bytes(data)
    read_markers(folder / "m.c3d")


def landmarks(data: bytes, folder: Path) -> None:
    """The same bytes as JSON and as CSV: what one refuses the other may take."""
    taken = 0
    for name in ("l.json", "l.csv"):
        (folder / name).write_bytes(data)
        with suppress(InputError):
            found = read_landmarks(folder / name)
            with suppress(InputError):
                trajectory_of(found, found.hand or "left")
            taken += 1
    if not taken:
        raise InputError("neither JSON nor CSV")


def protocol(data: bytes, folder: Path) -> None:
    (folder / "p").mkdir(exist_ok=True)
    (folder / "p" / "tapping.json").write_bytes(data)
    found, faults = protocols.read(folder / "p")
    assert len(found) + len(faults) == 1


def qualisys(data: bytes, folder: Path) -> None:
    (folder / "m.tsv").write_bytes(data)
    read_table(folder / "m.tsv")


def table(data: bytes, folder: Path) -> None:
    read_once.cache_clear()
    (folder / "t.csv").write_bytes(data)
    seen = preview(folder / "t.csv")
    if seen.guess is not None and seen.guess.columns.sensors:
        check_table(folder / "t.csv", seen.guess.columns)
        import_table(folder / "t.csv", seen.guess.columns, (), folder / "r.mcap", {})


def mvnx(data: bytes, folder: Path) -> None:
    _guessed(data, folder / "t.mvnx")


def bvh(data: bytes, folder: Path) -> None:
    _guessed(data, folder / "t.bvh")


def _guessed(data: bytes, path: Path) -> None:
    path.write_bytes(data)
    guess_map(path)


def ornt(data: bytes, folder: Path) -> None:
    """Lines of component, type, tracked point and units, as channels.tsv has them."""
    names = ("name", "component", "type", "tracked_point", "units")
    rows = [line.split("\t") for line in data.decode("latin-1").split("\n")]
    channels = [dict(zip(names, ["channel", *row])) for row in rows if len(row) == 4]
    orientation_columns("device", channels)


def slimevr(data: bytes, folder: Path) -> None:
    """A datagram of a tracker."""
    with suppress(CutShortError):
        list(packets_of(data))


def marker(data: bytes, folder: Path) -> None:
    """A marker of an LSL stream."""
    marker_event(data.decode("latin-1"), 1)


def column_map(data: bytes, folder: Path) -> None:
    (folder / "m.json").write_bytes(data)
    read_map(folder / "m.json")


def restored(data: bytes, folder: Path) -> None:
    (folder / "b.zip").write_bytes(data)
    backup.restore(folder / "b.zip", folder / "restored")


def _sent() -> list[Any]:
    samples = {
        name: cut(in_strips("left").samples[name], [20])[0] for name in ("hand", "index", "forearm")
    }
    return whole_session(samples)


def _framed() -> list[bytes]:
    return [b"".join(frames([s.message for s in _sent()]))]


def _pieces() -> list[bytes]:
    """The payloads of good frames."""
    bodies = [cobs.decode(frame[:-1])[2:-4] for frame in frames([s.message for s in _sent()])]
    return [b"".join(bytes([len(b)]) + b for b in bodies if len(b) < 256)]


def _recorded() -> list[bytes]:
    from handscope.sessions.files.recorder import Recorder

    with tempfile.TemporaryDirectory() as folder:
        with Recorder(
            Path(folder) / "r.mcap", {"hand": "left", "geometry": {"hand_length": 0.19}}, 100.0
        ) as recorder:
            for sent, frame in zip(_sent(), frames([s.message for s in _sent()])):
                recorder.write(frame, sent.arrival)
        return [(Path(folder) / "r.mcap").read_bytes()]


def _zipped() -> list[bytes]:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, data in dataset().items():
            archive.writestr(name, data)
    return [made.getvalue()]


def _joined() -> list[bytes]:
    return [b"\1\0\1".join(name.encode() + b"\0" + data for name, data in dataset().items())]


def _marked() -> list[bytes]:
    from tests.sessions.formats.test_c3d import places, written

    with tempfile.TemporaryDirectory() as folder:
        return [written(Path(folder) / "m.c3d", places(5)).read_bytes()]


def _exported() -> list[bytes]:
    names = [*BACK, ELBOWS[0], *(f"{f}_{place}" for f in FINGERS for place in ("middle", "tip"))]
    head = [
        "NO_OF_FRAMES\t3",
        "FREQUENCY\t100",
        "\t".join(["MARKER_NAMES", *names]),
        "Frame\tTime\tX\tY\tZ",
    ]
    rows = ["\t".join(f"{k + 0.1 * j:.3f}" for j in range(2 + 3 * len(names))) for k in range(3)]
    return ["\n".join([*head, *rows]).encode()]


def _logged() -> list[bytes]:
    names = [f"index_middle {kind} {axis}" for kind in ("gyr [deg/s]", "acc") for axis in "XYZ"]
    rows = [f"{10 * k};1,5;-2,25;0;0;0;9,81" for k in range(40)]
    plain = "\n".join(["0.01,1,2,3,0,0,1"] * 5)
    return ["\n".join([";".join(["time", *names]), *rows]).encode(), plain.encode()]


def _mapped() -> list[bytes]:
    gyr = {"columns": ["a", 1, 2], "unit": "deg/s"}
    sensors = {"hand": {"gyr": gyr, "mounting": [1, 0, 0, 0]}}
    layout = {"delimiter": ";", "decimal": ",", "header": True, "skip": 2}
    value = {
        "hand": "left",
        "table": layout,
        "rate": 100.0,
        "sensors": sensors,
        "geometry": {"hand_length": 0.18},
    }
    return [json.dumps(value).encode()]


def _seen() -> list[bytes]:
    from tests.sessions.formats.test_landmarks import layouts

    return [text.encode() for _, text in layouts().values()]


def _tasks() -> list[bytes]:
    folder = Path(str(protocols.__file__)).parent
    return [(folder / f"{name}.json").read_bytes() for name in ("tapping", "rom_fist", "kapandji")]


def _backed_up() -> list[bytes]:
    from tests.sessions.store.test_backup import filled

    with tempfile.TemporaryDirectory() as folder:
        store = filled(open_store(Path(folder) / "data"))
        backup.write(store.folder, None, Path(folder) / "b.zip", "1")
        store.close()
        return [(Path(folder) / "b.zip").read_bytes()]


def _mvnx_seeds() -> list[bytes]:
    frame = '<frame time="{}" index="{}" type="normal"><orientation>1 0 0 0 1 0 0 0</orientation></frame>'
    frames = "".join(frame.format(10 * k, k) for k in range(3))
    segments = '<segment label="RightForeArm"/><segment label="RightHand"/>'
    return [f"<mvnx><segments>{segments}</segments><frames>{frames}</frames></mvnx>".encode()]


def _bvh_seeds() -> list[bytes]:
    joint = "JOINT RightHand\n{\nOFFSET 0 0 0\nCHANNELS 3 Yrotation Xrotation Zrotation\n}\n"
    root = "ROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
    motion = "MOTION\nFrames: 2\nFrame Time: 0.01\n0 0 0 1 2 3\n0 0 0 1 2 3\n"
    return [f"HIERARCHY\n{root}{joint}}}\n{motion}".encode()]


def _ornt_seeds() -> list[bytes]:
    return ["\n".join(f"quat_{c}\tORNT\thand\tn/a" for c in "wxyz").encode()]


def _slime_seeds() -> list[bytes]:
    q = (1.0, 0.0, 0.0, 0.0)
    parts = [(17, slime.rotation(0, q)), (13, bytes([0, 1]))]
    return [
        slime.handshake(),
        slime.sensor_info(1, 0, 24),
        slime.bundle(2, parts),
        slime.compact_bundle(3, parts),
    ]


def _marker_seeds() -> list[bytes]:
    return [b'{"trial_type": "initial_pose", "duration": 3, "held_by": "therapist"}', b"start"]


TARGETS = {
    "wire": Target(wire, _framed, refuses=False),
    "payloads": Target(payloads, _pieces, refuses=False),
    "recording": Target(recording, _recorded),
    "bids": Target(bids, _zipped),
    "bids_files": Target(bids_files, _joined),
    "c3d": Target(markers, _marked),
    "qualisys": Target(qualisys, _exported),
    "table": Target(table, _logged),
    "mvnx": Target(mvnx, _mvnx_seeds),
    "bvh": Target(bvh, _bvh_seeds),
    "ornt": Target(ornt, _ornt_seeds),
    "slimevr": Target(slimevr, _slime_seeds, refuses=False),
    "marker": Target(marker, _marker_seeds, refuses=False),
    "column_map": Target(column_map, _mapped),
    "landmarks": Target(landmarks, _seen),
    "protocol": Target(protocol, _tasks, refuses=False),
    "backup": Target(restored, _backed_up),
    "xlsx": Target(binary_tables.reader(".xlsx"), binary_tables.spreadsheets),
    "parquet": Target(binary_tables.reader(".parquet"), binary_tables.parquets),
    "xdf": Target(binary_tables.reader(".xdf"), binary_tables.xdfs),
    "relay": Target(web_input.relay, web_input.relay_seeds, refuses=False),
    "photograph": Target(web_input.photograph, web_input.photograph_seeds),
    "fhir_answer": Target(web_input.fhir_answer, web_input.fhir_seeds),
}


@cache
def seeds(name: str) -> list[bytes]:
    return TARGETS[name].seeds()


def run(name: str, data: bytes) -> bool:
    """Whether the target took the input; an exception that is no refusal, a hang or a stray file goes on to the caller."""
    target = TARGETS[name]
    with (
        tempfile.TemporaryDirectory(prefix="handscope-fuzz-") as folder,
        _no_longer_than(HANG),
        writes_within(Path(folder)),
    ):
        try:
            target.read(data, Path(folder))
        except InputError as refusal:
            if not target.refuses or not str(refusal):
                raise AssertionError("refused without a word") from refusal
            return False
    return True


class HangError(Exception):
    """It took too long."""


@contextmanager
def _no_longer_than(seconds: int) -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise HangError(f"took longer than {seconds} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


_allowed: list[tuple[Path, ...]] = []  # folders that may be written to now, innermost last
_strays: list[str] = []
_listening: list[bool] = []
OWN = ("__pycache__", "/dev/", "/proc/")


@contextmanager
def writes_within(*folders: Path) -> Iterator[None]:
    """AssertionError where this process opens, moves or makes a file anywhere else meanwhile; the interpreter's own caches apart."""
    if not _listening:
        _listening.append(True)
        sys.addaudithook(_hear)
    _strays.clear()
    _allowed.append(tuple(f.resolve() for f in folders))
    try:
        yield
    finally:
        _allowed.pop()
    assert not _strays, f"wrote outside its folder: {_strays[:3]}"


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if not _allowed:
        return
    if event == "open":
        path, _, flags = arguments
        touched = [path] if isinstance(path, (str, bytes)) and (flags or 0) & WRITES else []
    elif event in ("os.mkdir", "os.remove", "os.rmdir"):
        touched = [_seen_from(arguments[-1], arguments[0])]
    elif event in ("os.rename", "os.link"):
        touched = [_seen_from(arguments[2], arguments[0]), _seen_from(arguments[3], arguments[1])]
    elif event == "os.symlink":
        touched = [_seen_from(arguments[2], arguments[1])]
    else:
        return
    for path in touched:
        with suppress(OSError, ValueError, TypeError):
            place = Path(path.decode() if isinstance(path, bytes) else path).resolve()
            if not any(place.is_relative_to(f) for f in _allowed[-1]) and not any(
                own in str(place) for own in OWN
            ):
                _strays.append(f"{event} {place}")


def _seen_from(folder: int, path: Any) -> Any:
    """A path that is told relative to an open folder (-1: to none)."""
    return (
        path
        if folder == -1 or not isinstance(path, str)
        else f"{Path(f'/proc/self/fd/{folder}').resolve()}/{path}"
    )
