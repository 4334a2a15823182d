"""scipy, pyarrow and json read the tables: names, units, values, where they came from."""

import io
import json
from collections.abc import Callable

import numpy as np
import pytest
from scipy.io import loadmat

from handscope.estimators.hand.anatomy import JOINT
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured


def test_scipy_reads_names_units_values_and_figures(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    read = loadmat(io.BytesIO(exported("mat").files[""]), simplify_cells=True)
    ours = measured.movement.angles[:, JOINT["index_pip"], 0]
    np.testing.assert_array_equal(read["index_pip_flexion"], ours)
    assert read["units"]["index_pip_flexion"] == "rad"
    assert read["units"]["index_tip_x"] == "m"
    assert read["about"]["recording_sha256"] == measured.origin.checksum
    assert read["about"]["simulated"] == 1
    known = {f.name: f for t in measured.tasks for f in t.figures}
    names = [str(n) for n in read["figures"]["name"]]
    at = names.index("index_mcp_flexion_max")
    assert read["figures"]["value"][at] == known["index_mcp_flexion_max"].value
    assert read["figures"]["sd"][at] == known["index_mcp_flexion_max"].sd


def test_pyarrow_reads_columns_with_units(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    read = pq.read_table(io.BytesIO(exported("parquet").files[""]))
    ours = measured.movement.angles[:, JOINT["index_pip"], 0]
    np.testing.assert_array_equal(read["index_pip_flexion"].to_numpy(), ours)
    assert read.schema.field("index_pip_flexion").metadata == {b"unit": b"rad"}
    about = json.loads(read.schema.metadata[b"handscope"])
    assert about["method"] == "m2"
    assert about["options"]["gyr_reading"] == "instant"


def test_every_line_of_jsonl_is_a_sample_after_one_that_tells_what_they_are(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    first, *lines = exported("jsonl").files[""].decode().splitlines()
    about = json.loads(first)["handscope"]
    assert about["hand"] == measured.recording.hand
    assert about["units"]["index_pip_flexion"] == "rad"
    assert len(lines) == len(measured.movement)
    sample = json.loads(lines[40])
    assert sample["time"] == measured.movement.t[40]
    assert sample["index_pip_flexion"] == measured.movement.angles[40, JOINT["index_pip"], 0]


@pytest.mark.parametrize("name", ["jsonl", "parquet", "mat"])
def test_what_is_not_known_stays_unknown(without_ring: Measured, name: str) -> None:
    if name == "parquet":
        pq = pytest.importorskip("pyarrow.parquet")
        read = pq.read_table(io.BytesIO(export(without_ring, name).files[""]))
        assert read["index_pip_flexion"].null_count == 10
    elif name == "mat":
        read = loadmat(io.BytesIO(export(without_ring, name).files[""]), simplify_cells=True)
        assert np.isnan(read["index_pip_flexion"]).sum() == 10
    else:
        lines = export(without_ring, name).files[""].decode().splitlines()
        assert json.loads(lines[1 + 55])["index_pip_flexion"] is None
