"""C3D files of other programs: markers in metres, hidden ones, units, and files that are broken anywhere."""

import struct
import warnings
from pathlib import Path
from typing import Any

import c3d
import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.formats.c3d import read_markers

NAMES = ("hand_1", "hand_2", "index_tip")


def written(
    path: Path,
    places: np.ndarray,
    names: tuple[str, ...] = NAMES,
    unit: str = "mm",
    rate: float = 120.0,
) -> Path:
    """A C3D file of places (n, markers, 3) in its unit; a marker that is not a number is marked as not seen."""
    writer = c3d.Writer(point_rate=rate, analog_rate=0, point_scale=-1.0, point_units=unit)
    writer.set_point_labels(names)
    seen = np.isfinite(places).all(axis=-1)
    points = np.zeros((*places.shape[:2], 5), np.float32)
    points[..., :3], points[..., 3] = (
        np.where(seen[..., None], places, 0.0),
        np.where(seen, 0.5, -1.0),
    )
    writer.add_frames([(frame, np.array([[]])) for frame in points])
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there are no analogue channels
        writer.write(file)
    return path


def places(n: int = 60) -> np.ndarray:
    return np.random.default_rng(0).normal(scale=100.0, size=(n, 3, 3))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1e-3), ("m", 1.0), ("cm", 1e-2)])
def test_markers_come_in_metres_with_their_names_and_rate(
    tmp_path: Path, unit: str, factor: float
) -> None:
    markers = read_markers(written(tmp_path / "a.c3d", places(), unit=unit))
    assert markers.names == NAMES
    np.testing.assert_allclose(markers.places, places() * factor, rtol=1e-6)
    np.testing.assert_allclose(markers.t, np.arange(60) / 120.0)


def test_a_hidden_marker_is_not_a_number(tmp_path: Path) -> None:
    hidden = places()
    hidden[10:20, 1] = np.nan
    markers = read_markers(written(tmp_path / "a.c3d", hidden))
    assert np.isnan(markers.places[10:20, 1]).all()
    assert np.isfinite(np.delete(markers.places, 1, axis=1)).all()


def test_a_file_that_is_cut_broken_or_none_is_refused_in_one_sentence(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole.c3d", places(400)).read_bytes()
    rng, broken = np.random.default_rng(1), tmp_path / "broken.c3d"
    for length in (0, 1, 300, 511, 700, 1500, len(whole) // 2, len(whole) - 600):
        broken.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"broken\.c3d"):
            read_markers(broken)
    for _ in range(30):  # anything may come back, or one sentence
        changed = bytearray(whole)
        for k in rng.integers(0, 2500, size=5):
            changed[k] = rng.integers(256)
        broken.write_bytes(changed)
        try:
            markers = read_markers(broken)
        except InputError:
            continue
        assert markers.places.shape == (len(markers.t), len(markers.names), 3)
    broken.write_bytes(b"Frame\tTime\n" * 100)
    with pytest.raises(InputError, match="is no C3D file"):
        read_markers(broken)


def test_no_file_no_unit_and_no_markers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_markers(tmp_path / "nothere.c3d")
    with pytest.raises(InputError, match="unknown unit 'inch'"):
        read_markers(written(tmp_path / "a.c3d", places(), unit="inch"))
    with pytest.raises(InputError, match="no markers over time"):
        read_markers(written(tmp_path / "b.c3d", places()[:1]))


def raw(
    places: np.ndarray,
    order: str = "<",
    scale: float = -1.0,
    units: tuple[str, ...] = ("mm",),
    first: int = 1,
    frames: int | None = None,
    analogue: tuple[int, int, int] = (0, 0, 1),
) -> bytes:
    """A file by the letter of the format (C3D user guide): `analogue` words a frame in the data, by the header, and by the parameters."""
    n, markers, _ = places.shape
    words, said, used = analogue
    width = max(len(u) for u in units)
    parameters = [
        _number("USED", order, "h", markers),
        _number("SCALE", order, "f", scale),
        _number("RATE", order, "f", 120.0),
        _number("FRAMES", order, "H", n if frames is None else frames),
        _text("UNITS", order, width, units),
        _text("LABELS", order, 12, NAMES[:markers]),
    ]
    section = (
        b"\x05\xff"
        + b"POINT"
        + struct.pack(order + "h", 3)
        + b"\0"
        + b"".join(b"%c\x01" % len(name) + name + rest for name, rest in parameters)
    )
    section += (
        b"\x06\xfe"
        + b"ANALOG"
        + struct.pack(order + "h", 3)
        + b"\0"
        + b"".join(
            b"%c\x02" % len(name) + name + rest
            for name, rest in [
                _number("USED", order, "h", used),
                _number("RATE", order, "f", 120.0),
            ]
        )
        + b"\0\0"
    )
    head = struct.pack(
        order + "BBhhhhhfhhf", 2, 80, markers, said, first, first + n - 1, 10, scale, 4, 1, 120.0
    )
    kind, factor = ("f", 1.0) if scale < 0 else ("h", scale)
    data = b""
    for frame in places:
        for place in frame:
            seen = bool(np.isfinite(place).all())
            values = [*(np.where(seen, place, 0.0) / factor), 0.0 if seen else -1.0]
            data += struct.pack(
                f"{order}4{kind}", *(values if kind == "f" else [round(v) for v in values])
            )
        data += struct.pack(f"{order}{words}{kind}", *[7] * words)
    processor = {"<": 84, ">": 86}[order]
    return b"".join(
        part + b"\0" * (-len(part) % 512)
        for part in (head, bytes([1, 80, 2, processor]) + section.ljust(1020, b"\0"), data)
    )


def _number(name: str, order: str, kind: str, value: float) -> tuple[bytes, bytes]:
    data = struct.pack(order + kind, value)
    body = bytes([len(data), 0]) + data + b"\0"
    return name.encode(), struct.pack(order + "h", len(body) + 2) + body


def _text(name: str, order: str, width: int, words: tuple[str, ...]) -> tuple[bytes, bytes]:
    body = (
        bytes([255, 2, width, len(words)])
        + b"".join(word.encode().ljust(width) for word in words)
        + b"\0"
    )
    return name.encode(), struct.pack(order + "h", len(body) + 2) + body


@pytest.mark.parametrize(
    ("what", "factor"),
    [
        ({}, 1e-3),
        ({"order": ">"}, 1e-3),  # MIPS
        ({"scale": 0.02}, 1e-3),  # integers
        ({"order": ">", "scale": 0.02}, 1e-3),
        ({"units": ("mm\0\0",)}, 1e-3),  # Motion Analysis, Simi
        ({"units": ("mm", "mm", "mm")}, 1e-3),  # Optotrak
        ({"units": ("mete",)}, 1.0),  # cut off after four letters
        ({"first": 0, "frames": 61}, 1e-3),  # OptiTrack
        ({"frames": 61}, 1e-3),
        ({"analogue": (5, 5, 5)}, 1e-3),
        ({"analogue": (12, 12, 120)}, 1e-3),  # the parameters are wrong
        ({"analogue": (14, 2, 14)}, 1e-3),  # the header is
    ],
)
def test_files_as_programs_write_them_are_read(
    tmp_path: Path, what: dict[str, Any], factor: float
) -> None:
    """Each of these came with a public sample of some program's; places as they were put in, a hidden marker hidden."""
    put = places()
    put[20:30, 1] = np.nan
    (tmp_path / "a.c3d").write_bytes(raw(put, **what))
    markers = read_markers(tmp_path / "a.c3d")
    assert markers.names == NAMES
    np.testing.assert_allclose(
        markers.places, put * factor, atol=factor * max(what.get("scale", 0.0), 1e-4)
    )
    np.testing.assert_allclose(markers.t, np.arange(60) / 120.0)


def test_a_contradiction_that_leaves_the_places_unsure_is_refused(tmp_path: Path) -> None:
    whole = raw(places(), scale=0.02)
    (tmp_path / "a.c3d").write_bytes(whole[:12] + struct.pack("<f", 0.05) + whole[16:])
    with pytest.raises(InputError, match=r"scales lengths by 0\.05, its parameters by 0\.02"):
        read_markers(tmp_path / "a.c3d")
    (tmp_path / "b.c3d").write_bytes(raw(places(), analogue=(7, 5, 9)))
    with pytest.raises(InputError, match="different numbers of analogue channels"):
        read_markers(tmp_path / "b.c3d")
