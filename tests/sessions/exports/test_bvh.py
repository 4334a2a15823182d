"""A reader of BVH puts the fingertips where we have them."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import FINGERS
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured
from tests.sessions.exports.conftest import instants

bvhio = pytest.importorskip("bvhio")


def test_bvhio_puts_the_fingertips_where_we_have_them(
    exported: Callable[[str], Exported], measured: Measured, tmp_path: Path
) -> None:
    (tmp_path / "a.bvh").write_bytes(exported("bvh").files[""])
    root = bvhio.readAsHierarchy(str(tmp_path / "a.bvh"))
    by_name = {joint.Name: joint for joint, *_ in root.layout()}
    ends = measured.geometry.chain_offsets()[:, 2]
    worst = 0.0
    for k in instants(len(measured.movement), 25):
        root.loadPose(int(k))
        for f, finger in enumerate(FINGERS):
            in_world = by_name[f"{finger}_distal"].pointToWorld(tuple(ends[f]))
            tip = np.array(by_name["forearm"].pointToLocal(in_world))
            worst = max(worst, float(np.linalg.norm(tip - measured.movement.tips[k, f])))
    assert worst < 1e-4


def test_frames_rate_and_bone_lengths_are_read(
    exported: Callable[[str], Exported], measured: Measured, tmp_path: Path
) -> None:
    (tmp_path / "a.bvh").write_bytes(exported("bvh").files[""])
    read = bvhio.readAsBvh(str(tmp_path / "a.bvh"))
    assert read.FrameCount == len(measured.movement)
    assert read.FrameTime == pytest.approx(0.07, abs=1e-6)
    (distal,) = [joint for joint, *_ in read.Root.layout() if joint.Name == "index_distal"]
    length = measured.geometry.lengths["index_middle"]
    assert np.linalg.norm(list(distal.Offset)) == pytest.approx(length, abs=1e-6)


def test_what_it_rests_on_lies_beside_it(exported: Callable[[str], Exported]) -> None:
    about = json.loads(exported("bvh").files[".json"])
    assert about["method"] == "m2"
    assert about["simulated"] is True
    assert about["unit"] == "m"


def test_a_finger_not_measured_is_no_branch_of_the_hierarchy(without_ring: Measured) -> None:
    text = export(without_ring, "bvh").files[""].decode()
    assert "JOINT ring_proximal" not in text
    assert "JOINT index_proximal" in text
    assert "nan" not in text
