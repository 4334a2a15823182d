"""Every bad Motion-BIDS input is one clear InputError that names the file and the remedy, never anything else."""

import re
from collections.abc import Callable
from itertools import cycle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.sessions import motion_bids
from tests.bids import (
    BASE,
    Files,
    dataset,
    folder,
    packed,
    recording,
    with_line,
    with_sidecar,
    with_text,
    without,
)

Break = Callable[[Files], Files]


def _channels(system: str, old: str, new: str) -> Break:
    return lambda files: with_text(
        files, f"_tracksys-{system}_channels.tsv", lambda text: text.replace(old, new, 1)
    )


MOTION = f"{BASE}_tracksys-index_motion.tsv"


def _in_ms(line: bytes) -> bytes:
    t, rest = line.split(b"\t", 1)
    return b"%f\t%s" % (1e3 * float(t), rest)


def _set_clock(lines: list[bytes]) -> list[bytes]:
    """From the middle on in seconds since 1970."""
    times = [line.split(b"\t", 1) for line in lines]
    later = [(1.728e9 if k > len(lines) // 2 else 0.0) for k in range(len(lines))]
    return [b"%f\t%s" % (float(t) + by, rest) for (t, rest), by in zip(times, later)]


def _motion(number: int, change: Callable[[str], str], system: str = "index") -> Break:
    return lambda files: with_line(files, f"_tracksys-{system}_motion.tsv", number, change)


def _sidecar(system: str, **changes: object) -> Break:
    return lambda files: with_sidecar(files, system, **changes)


def _events(text: str) -> Break:
    return lambda files: files | {f"{BASE}_events.tsv": text.encode()}


def _replaced(suffix: str, data: bytes) -> Break:
    return lambda files: files | {BASE + suffix: data}


def _without_column(system: str, name: str) -> Break:
    """The channel and its column, both gone."""

    def change(files: Files) -> Files:
        channels = files[f"{BASE}_tracksys-{system}_channels.tsv"].decode().splitlines()
        k = next(i for i, line in enumerate(channels) if line.startswith(f"{name}\t"))
        rows = [
            line.split("\t")
            for line in files[f"{BASE}_tracksys-{system}_motion.tsv"].decode().splitlines()
        ]
        return files | {
            f"{BASE}_tracksys-{system}_channels.tsv": "\n".join(
                channels[:k] + channels[k + 1 :]
            ).encode(),
            f"{BASE}_tracksys-{system}_motion.tsv": "\n".join(
                "\t".join(r[: k - 1] + r[k:]) for r in rows
            ).encode(),
        }

    return change


def _hand_of_each(*hands: str | None) -> Break:
    def change(files: Files) -> Files:
        for system, hand in zip(recording().samples, cycle(hands)):
            files = with_sidecar(files, system, MeasuredHand=hand)
        return files

    return change


def _all(*breaks: Break) -> Break:
    def change(files: Files) -> Files:
        for one in breaks:
            files = one(files)
        return files

    return change


def _twice(files: Files) -> Files:
    return files | {
        name.replace("tracksys-index", "tracksys-copy"): data
        for name, data in files.items()
        if "tracksys-index" in name
    }


def _second_task(files: Files) -> Files:
    return files | {
        name.replace("task-hand", "task-grip"): data
        for name, data in files.items()
        if "task-hand" in name
    }


BROKEN: dict[str, tuple[Break, str]] = {
    # what is wrong: (how to make it so, what must be said)
    "an unknown unit of rate": (
        _channels("index", "rad/s", "rpm"),
        "tracksys-index.*'rpm'.*rad/s or deg/s",
    ),
    "an unknown unit of acceleration": (
        _channels("index", "m/s^2", "g"),
        "tracksys-index.*'g'.*m/s",
    ),
    "an unknown unit of a magnetometer": (
        _channels("mag", "\tT\t", "\tGauss\t"),
        "tracksys-mag.*'Gauss'.*T or uT",
    ),
    "an unknown unit of force": (
        _channels("force", "\tN\t", "\tkg\t"),
        "tracksys-force.*'kg'.*N or N\\*m, or tell.*ForceSetup from `handscope calibrate-force`",
    ),
    "an unknown unit of torque": (
        _channels("force", "\tN*m\t", "\tkgf*cm\t"),
        "tracksys-force.*'kgf\\*cm'.*N or N\\*m",
    ),
    "an unknown unit of time": (_channels("hand", "\ts\t", "\tms\t"), "tracksys-hand.*'ms'.*s"),
    "no unit": (_channels("index", "rad/s", "n/a"), "tracksys-index.*'n/a'"),
    "a missing component": (
        _without_column("index", "index_middle_acc_z"),
        "tracksys-index: index_middle has not all of x, y, z of acc; name the three channels",
    ),
    "a component that is none": (
        _channels("index", "index_middle_gyr_z\tz", "index_middle_gyr_z\tw"),
        "index_middle_gyr_z.*'w'; it is x, y or z",
    ),
    "an empty component": (
        _channels("index", "index_middle_gyr_z\tz", "index_middle_gyr_z\t"),
        "index_middle_gyr_z.*it is x, y or z",
    ),
    "a component twice": (
        _channels("index", "index_middle_gyr_z\tz", "index_middle_gyr_z\ty"),
        "index_middle has two GYRO channels for component y",
    ),
    "sensors of two hands": (
        _all(
            _channels("mag", "MAGN\thand", "MAGN\tleft_index_distal"),
            _channels("mag", "MAGN\tindex_distal", "MAGN\tright_index_distal"),
        ),
        "tracksys-mag holds sensors of two hands.*split it",
    ),
    "two hands measured": (
        _hand_of_each("left", "right"),
        "sensors of two hands.*MeasuredHand.*split it",
    ),
    "no hand measured": (_hand_of_each(None), "does not say which hand.*MeasuredHand"),
    "a hand that is none": (_hand_of_each("both"), "MeasuredHand is 'both'; it is left or right"),
    "no samples": (
        _replaced("_tracksys-index_motion.tsv", b""),
        "tracksys-index_motion.tsv has 0 samples",
    ),
    "only empty lines": (
        _replaced("_tracksys-index_motion.tsv", b"\n\n\t\n"),
        "tracksys-index_motion.tsv has 0 samples",
    ),
    "a short line": (
        _motion(7, lambda line: line.rsplit("\t", 1)[0]),
        r"tracksys-index_motion.tsv, line 7: wrong number of columns, 18; its channels.tsv names 19",
    ),
    "a long line": (
        _motion(30, lambda line: line + "\t1.0"),
        r"tracksys-index_motion.tsv, line 30: wrong number of columns, 20; its channels.tsv names 19",
    ),
    "a column too few everywhere": (
        lambda files: with_text(
            files, "_tracksys-index_motion.tsv", lambda text: re.sub(r"\t[^\t\n]+\n", "\n", text)
        ),
        "tracksys-index_motion.tsv.*wrong number of columns, 18; its channels.tsv names 19",
    ),
    "text in numbers": (
        _motion(4, lambda line: line.replace("\t", "\tabc", 1)),
        r"tracksys-index_motion.tsv, line 4, column 2: 'abc.*is not a number",
    ),
    "a decimal comma": (
        _motion(4, lambda line: line.replace(".", ",", 1)),
        r"tracksys-index_motion.tsv, line 4, column 1: '0,",
    ),
    "an empty cell": (
        _motion(4, lambda line: re.sub(r"\t[^\t]+\t", "\t\t", line, count=1)),
        r"line 4, column 2: '' is not a number",
    ),
    "a header line": (
        _motion(1, lambda line: "\t".join(["time", *["x"] * 18]) + "\n" + line),
        r"line 1, column 1: 'time' is not a number",
    ),
    "a comment": (
        _motion(1, lambda line: "# made by hand\n" + line),
        r"line 1: wrong number of columns, 1;",
    ),
    "bytes that are no text": (
        _motion(
            2, lambda line: line.replace("\t", "\t\ud800", 1).encode("utf-8", "replace").decode()
        ),
        "line 2, column 2",
    ),
    "another encoding": (
        lambda files: (
            files
            | {
                f"{BASE}_tracksys-index_motion.tsv": files[f"{BASE}_tracksys-index_motion.tsv"]
                .decode()
                .encode("utf-16")
            }
        ),
        "tracksys-index_motion.tsv",
    ),
    "time that stands still": (
        _motion(6, lambda line: "\t".join(["0.14", *line.split("\t")[1:]])),
        r"tracksys-index_motion.tsv, line 6: LATENCY does not increase",
    ),
    "time in ms": (
        lambda files: files | {MOTION: b"\n".join(map(_in_ms, files[MOTION].splitlines())) + b"\n"},
        r"tracksys-index_motion.tsv: by LATENCY there are 0\.\d+ samples a second",
    ),
    "a clock that is set": (
        lambda files: files | {MOTION: b"\n".join(_set_clock(files[MOTION].splitlines())) + b"\n"},
        r"the time stamps jump by 20000 days behind",
    ),
    "time that is missing": (
        _motion(6, lambda line: "\t".join(["n/a", *line.split("\t")[1:]])),
        r"line 6: LATENCY does not increase",
    ),
    "time that is missing at the start": (
        _motion(1, lambda line: "\t".join(["n/a", *line.split("\t")[1:]])),
        r"LATENCY does not increase",
    ),
    "neither time nor rate": (
        _all(_channels("hand", "LATENCY", "OTHER"), _sidecar("hand", SamplingFrequency=None)),
        "tracksys-hand.*SamplingFrequency.*LATENCY",
    ),
    "a rate that is no rate": (
        _all(_channels("hand", "LATENCY", "OTHER"), _sidecar("hand", SamplingFrequency="fast")),
        "SamplingFrequency",
    ),
    "a rate of zero": (
        _all(_channels("hand", "LATENCY", "OTHER"), _sidecar("hand", SamplingFrequency=0)),
        "SamplingFrequency",
    ),
    "no channels.tsv": (
        lambda files: without(files, "_tracksys-index_channels.tsv"),
        "tracksys-index_channels.tsv is missing",
    ),
    "no motion.json": (
        lambda files: without(files, "_tracksys-index_motion.json"),
        "tracksys-index_motion.json is missing",
    ),
    "a sidecar that is no JSON": (
        _replaced("_tracksys-index_motion.json", b'{"a": '),
        "tracksys-index_motion.json is not valid JSON",
    ),
    "a sidecar nested without end": (
        _replaced("_tracksys-index_motion.json", b"[" * 100_000),
        "tracksys-index_motion.json is not valid JSON",
    ),
    "a sidecar that is no object": (
        _replaced("_tracksys-index_motion.json", b"[1]"),
        "tracksys-index_motion.json does not hold a JSON object",
    ),
    "a sidecar that is no text": (
        _replaced("_tracksys-index_motion.json", b"\xff\xfe{"),
        "tracksys-index_motion.json is not valid JSON",
    ),
    "channels that are no text": (
        _replaced("_tracksys-index_channels.tsv", b"\xff\xfe"),
        "tracksys-index_channels.tsv is not UTF-8",
    ),
    "channels without a header": (
        _replaced("_tracksys-index_channels.tsv", b""),
        "tracksys-index_channels.tsv is empty",
    ),
    "channels without units": (
        _channels("index", "units", "unit"),
        "tracksys-index_channels.tsv has no column units",
    ),
    "a channel with a cell too many": (
        lambda files: with_line(
            files, "_tracksys-index_channels.tsv", 3, lambda line: line + "\tx"
        ),
        "tracksys-index_channels.tsv, line 3: wrong number of columns, 7 instead of 6",
    ),
    "points in two tracking systems": (
        _twice,
        "index_proximal has samples of gyr in both tracksys-copy and tracksys-index; keep one",
    ),
    "an empty line among the samples": (
        _motion(9, lambda line: line + "\n"),
        r"tracksys-index_motion.tsv, line 10: wrong number of columns, 1;",
    ),
    "an empty first line": (
        _motion(1, lambda line: "\n" + line),
        r"tracksys-index_motion.tsv, line 1: wrong number of columns, 1;",
    ),
    "an empty line among the samples of another system": (
        _motion(9, lambda line: line + "\r\n\r"),
        r"tracksys-index_motion.tsv, line 10",
    ),
    "an event behind empty lines": (
        _events("onset\tduration\ttrial_type\n\n\nsoon\t1\ttask\n"),
        "events.tsv, line 4.*'soon'",
    ),
    "an onset that is no number": (
        _events("onset\tduration\ttrial_type\nsoon\t1\ttask\n"),
        "events.tsv, line 2.*'soon'",
    ),
    "a negative duration": (
        _events("onset\tduration\ttrial_type\n1\t-1\ttask\n"),
        "events.tsv, line 2.*not negative",
    ),
    "an infinite onset": (
        _events("onset\tduration\ttrial_type\ninf\t1\ttask\n"),
        "events.tsv, line 2.*finite",
    ),
    "events without their type": (
        _events("onset\tduration\n1\t1\n"),
        "events.tsv has no column trial_type",
    ),
    "an event with a cell too few": (
        _events("onset\tduration\ttrial_type\n1\t1\ttask\n2\t1\n"),
        "events.tsv, line 3: wrong number of columns, 2 instead of 3",
    ),
    "a thumb angle in words": (
        _events("onset\tduration\ttrial_type\tthumb_cmc_flexion_deg\n1\t3\tinitial_pose\tbent\n"),
        "line 2: thumb_cmc_flexion_deg 'bent' is not a number of degrees",
    ),
    "a hand in millimetres": (
        _all(*(_sidecar(s, HandGeometry={"hand_length": 190}) for s in recording().samples)),
        "hand length: 190000 mm is outside.*metres",
    ),
    "hands of two sizes": (
        _sidecar("index", HandGeometry={"palm_length": 0.09}),
        "HandGeometry of palm_length differs",
    ),
    "a geometry that is no object": (
        _sidecar("index", HandGeometry=[0.19]),
        "tracksys-index: HandGeometry.*not an object",
    ),
    "an unknown length": (_sidecar("index", HandGeometry={"toe": 0.05}), "unknown entries.*toe"),
    "a mounting that is no quaternion": (
        _sidecar("index", SensorMounting={"index_middle": [1, 0, 0]}),
        "SensorMounting of index_middle",
    ),
    "a mounting that is no rotation": (
        _sidecar("index", SensorMounting={"index_middle": [1, 1, 0, 0]}),
        "SensorMounting of index_middle",
    ),
    "a mounting in words": (
        _sidecar("index", SensorMounting={"index_middle": "upside down"}),
        "SensorMounting of index_middle",
    ),
    "several recordings": (
        _second_task,
        r"holds several recordings \(2: sub-01_task-grip, sub-01_task-hand\); give the path of one of their motion.tsv",
    ),
    "no recording": (
        lambda files: {"README": b"nothing"},
        "holds no Motion-BIDS recording; expected sub-",
    ),
    "nothing inertial": (
        lambda files: {n: d for n, d in files.items() if "mag" in n or "force" in n},
        "has no inertial samples",
    ),
}


@pytest.mark.parametrize("what", BROKEN)
@pytest.mark.parametrize("kind", ["folder", "zip"])
def test_what_is_wrong_is_said_with_file_and_remedy(tmp_path: Path, what: str, kind: str) -> None:
    change, said = BROKEN[what]
    files = change(dataset())
    path = folder(files, tmp_path / "dataset") if kind == "folder" else tmp_path / "dataset.zip"
    if kind == "zip":
        path.write_bytes(packed(files))
    with pytest.raises(InputError) as refusal:
        motion_bids.load(path)
    assert re.search(said, str(refusal.value), re.DOTALL), str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.__cause__ is None


@pytest.mark.parametrize("kind", ["folder", "zip"])
def test_the_dataset_that_these_break_is_good(tmp_path: Path, kind: str) -> None:
    path = folder(dataset(), tmp_path / "dataset") if kind == "folder" else tmp_path / "dataset.zip"
    if kind == "zip":
        path.write_bytes(packed(dataset()))
    assert motion_bids.load(path).warnings == ()


def test_a_hand_other_than_the_one_wanted_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="recorded on the left hand, not on the right one"):
        motion_bids.load(folder(dataset(), tmp_path), "right")


def test_the_path_of_a_file_that_is_no_recording_does_not_open_the_one_beside_it(
    tmp_path: Path,
) -> None:
    place = folder(dataset() | {"sub-01/motion/notes_motion.tsv": b"1\n"}, tmp_path)
    with pytest.raises(InputError, match=r"notes_motion\.tsv holds no Motion-BIDS recording"):
        motion_bids.load(place / "sub-01/motion/notes_motion.tsv")


def test_a_path_that_leads_nowhere_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        motion_bids.load(tmp_path / "nowhere")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(InputError, match="neither a folder, a zip nor a native recording"):
        motion_bids.load(tmp_path / "notes.txt")


def _zip_refusal(place: Path, data: bytes) -> str:
    path = place / "upload.zip"
    path.write_bytes(data)
    with pytest.raises(InputError) as refusal:
        motion_bids.load(path)
    assert "upload.zip" in str(refusal.value)
    return str(refusal.value)


@given(share=st.floats(0, 1, exclude_max=True))
def test_a_zip_cut_anywhere_is_refused(
    tmp_path_factory: pytest.TempPathFactory, share: float
) -> None:
    whole = packed(dataset())
    said = _zip_refusal(tmp_path_factory.getbasetemp(), whole[: int(share * len(whole))])
    assert "zip" in said


@given(
    flips=st.dictionaries(
        st.floats(0, 1, exclude_max=True), st.integers(1, 255), min_size=1, max_size=3
    )
)
def test_a_zip_with_flipped_bytes_is_refused_or_gives_the_same(
    tmp_path_factory: pytest.TempPathFactory, flips: dict[float, int]
) -> None:
    damaged = bytearray(packed(dataset()))
    for share, how in flips.items():
        damaged[int(share * len(damaged))] ^= how
    path = tmp_path_factory.getbasetemp() / "flipped.zip"
    path.write_bytes(damaged)
    try:
        motion_bids.load(path)
    except InputError:
        pass


@given(data=st.data())
def test_a_dataset_with_anything_in_any_file_is_refused_or_read(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    files = dataset()
    name = data.draw(st.sampled_from(sorted(n for n in files if n.startswith("sub-"))))
    text = files[name]
    first = data.draw(st.integers(0, len(text)))
    last = data.draw(st.integers(first, min(first + 20, len(text))))
    junk = data.draw(
        st.binary(max_size=6)
        | st.sampled_from(
            [b"\t", b"\n", b"\r", b"n/a", b"-", b"1e999", b'"', b"{}", b"null", b"[]"]
        )
    )
    path = tmp_path_factory.getbasetemp() / "junk.zip"
    path.write_bytes(packed(files | {name: text[:first] + junk + text[last:]}))
    try:
        motion_bids.load(path)
    except InputError:
        pass


def test_a_zip_bomb_is_not_opened(tmp_path: Path) -> None:
    bomb = {f"{BASE}_tracksys-index_motion.tsv": b"0" * (20 * 2**20)}
    assert "no recording does that" in _zip_refusal(tmp_path, packed(dataset() | bomb))


def test_a_zip_of_too_many_or_too_large_files_is_not_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handscope.sessions.motion_bids.files.MOST_BYTES", 1000)
    assert "split the recording" in _zip_refusal(tmp_path, packed(dataset()))
    monkeypatch.setattr("handscope.sessions.motion_bids.files.MOST_FILES", 3)
    assert "at most 3" in _zip_refusal(tmp_path, packed(dataset()))
    with pytest.raises(InputError, match="more than 3"):
        motion_bids.load(folder(dataset(), tmp_path / "folder"))


@pytest.mark.parametrize(
    "name",
    [
        "../evil.tsv",
        "sub-01/../../evil.tsv",
        "/etc/evil.tsv",
        "..\\evil.tsv",
        "C:/evil.tsv",
        "\\evil.tsv",
    ],
)
def test_a_zip_that_climbs_out_of_its_folder_is_not_opened(tmp_path: Path, name: str) -> None:
    assert "climb out" in _zip_refusal(tmp_path, packed({**dataset(), name: b"x"}))


def test_a_zip_with_a_link_is_not_opened(tmp_path: Path) -> None:
    def link(entry: object) -> None:
        if entry.filename.endswith("_events.tsv"):
            entry.create_system, entry.external_attr = 3, 0o120777 << 16

    assert "holds a link" in _zip_refusal(tmp_path, packed(dataset(), link))


def test_an_encrypted_zip_is_refused(tmp_path: Path) -> None:
    data = bytearray(packed(dataset()))
    k = data.index(b"PK\x01\x02")
    data[k + 8] |= 1
    assert "is encrypted; unpack it" in _zip_refusal(tmp_path, bytes(data))


def test_a_link_out_of_a_folder_is_not_followed(tmp_path: Path) -> None:
    secret = tmp_path / "secret.tsv"
    secret.write_bytes(b"onset\tduration\ttrial_type\n1\t1\tsecret\n")
    place = folder(without(dataset(), "_events.tsv"), tmp_path / "dataset")
    (place / f"{BASE}_events.tsv").symlink_to(secret)
    assert motion_bids.load(place).events == ()
