"""Every export carries what it rests on: software, method with options, the recording's hash, "simulated"; and no name."""

import io
import json
from collections.abc import Callable

import pytest
from scipy.io import loadmat

from handscope.sessions.exports import FORMATS
from handscope.sessions.exports.measured import Exported, Measured

WITH_MOVEMENT = sorted(set(FORMATS) - {"bids"})  # that holds the recording itself


def words_of(name: str, made: Exported) -> str:
    """What a format's own reader finds in the files, as text."""
    if name == "parquet":
        pq = pytest.importorskip("pyarrow.parquet")
        found = pq.read_schema(io.BytesIO(made.files[""])).metadata
        return str({k.decode(): v.decode() for k, v in found.items()})
    if name == "mat":
        return str(loadmat(io.BytesIO(made.files[""]), simplify_cells=True)["about"])
    if name == "mcap-ros2":
        reader = pytest.importorskip("mcap.reader")
        found = reader.make_reader(io.BytesIO(made.files[""])).iter_metadata()
        return str([record.metadata for record in found])
    return " ".join(content.decode("utf-8", "ignore") for content in made.files.values())


@pytest.mark.parametrize("name", WITH_MOVEMENT)
def test_an_export_says_where_it_comes_from(
    name: str, exported: Callable[[str], Exported], measured: Measured
) -> None:
    words, origin = words_of(name, exported(name)), measured.origin
    assert origin.checksum in words
    assert origin.software in words
    assert origin.method in words
    assert "heading_correction" in words and "pose_duration" in words  # options of m2
    assert "simulated" in words.lower() or "HTEST" in words


def test_raw_samples_say_what_wrote_them_and_from_which_recording(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    about = json.loads(exported("bids").files["dataset_description.json"])
    assert about["GeneratedBy"] == [{"Name": "Handscope", "Version": measured.origin.software}]
    assert about["SourceDatasets"] == [{"Version": f"sha256:{measured.origin.checksum}"}]
