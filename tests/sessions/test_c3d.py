"""C3D files of other programs: markers in metres, hidden ones, units, and files that are broken anywhere."""

import warnings
from pathlib import Path

import c3d
import numpy as np
import pytest

from estimators.errors import InputError
from sessions.c3d import read_markers

NAMES = ("hand_1", "hand_2", "index_tip")


def written(path: Path, places: np.ndarray, names: tuple[str, ...] = NAMES, unit: str = "mm", rate: float = 120.0) -> Path:
    """A C3D file of places (n, markers, 3) in its unit; a marker that is not a number is marked as not seen."""
    writer = c3d.Writer(point_rate=rate, analog_rate=0, point_scale=-1.0, point_units=unit)
    writer.set_point_labels(names)
    seen = np.isfinite(places).all(axis=-1)
    points = np.zeros((*places.shape[:2], 5), np.float32)
    points[..., :3], points[..., 3] = np.where(seen[..., None], places, 0.0), np.where(seen, 0.5, -1.0)
    writer.add_frames([(frame, np.array([[]])) for frame in points])
    with path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there are no analogue channels
        writer.write(file)
    return path


def places(n: int = 60) -> np.ndarray:
    return np.random.default_rng(0).normal(scale=100.0, size=(n, 3, 3))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1e-3), ("m", 1.0), ("cm", 1e-2)])
def test_markers_come_in_metres_with_their_names_and_rate(tmp_path: Path, unit: str, factor: float) -> None:
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
