"""Every reference value has a source and lies where the joint can go."""

import json

import pytest

from handscope.app.report.references import (
    FILE,
    Reference,
    references,
    smallest_change,
    smallest_change_of_rate,
)
from handscope.estimators.hand.anatomy import ANGLES, JOINT, JOINTS


@pytest.mark.parametrize("reference", references(), ids=lambda r: f"{r.joint}-{r.angle}-{r.end}")
def test_a_reference_value_has_a_source_and_is_plausible(reference: Reference) -> None:
    assert reference.source.name.strip()
    assert len(reference.source.reference) > len(reference.source.name)
    low, high = JOINTS[JOINT[reference.joint]].limits[ANGLES.index(reference.angle)]
    assert low < reference.degrees < high
    assert reference.degrees >= 0 if reference.end == "largest" else reference.degrees <= 0


def test_no_value_stands_twice_and_every_source_is_used() -> None:
    assert len({(r.joint, r.angle, r.end) for r in references()}) == len(references())
    file = json.loads(FILE.read_text("utf-8"))
    used = {v["also"]["source"] for v in file["values"] if "also" in v}
    used |= {
        v["source"] for table in ("values", "norms", "smallest_changes") for v in file[table]
    } | {file[name]["source"] for name in ("smallest_change", "smallest_change_of_rate")}
    assert used == set(file["sources"])


def test_every_hinge_of_the_hand_has_a_largest_and_a_smallest_flexion() -> None:
    given = {(r.joint, r.end) for r in references() if r.angle == "flexion"}
    hinges = {j.name for j in JOINTS} - {"thumb_cmc"}
    assert {(joint, end) for joint in hinges for end in ("largest", "smallest")} <= given


@pytest.mark.parametrize(
    ("joint", "angle", "end", "degrees"),
    [
        ("index_mcp", "flexion", "largest", 90),
        ("ring_pip", "flexion", "largest", 100),
        ("little_dip", "flexion", "largest", 80),
        ("middle_pip", "flexion", "smallest", 0),
        ("thumb_ip", "flexion", "largest", 88),
        ("thumb_mcp", "flexion", "smallest", -8.1),
        ("thumb_cmc", "flexion", "largest", 48),
        ("wrist", "flexion", "smallest", -70),
        ("wrist", "deviation", "largest", 30),
    ],
)
def test_values_are_the_published_ones(joint: str, angle: str, end: str, degrees: float) -> None:
    (found,) = [r.degrees for r in references() if (r.joint, r.angle, r.end) == (joint, angle, end)]
    assert found == degrees


def test_a_fingers_joints_have_the_values_that_its_total_motion_counts_as_well() -> None:
    ring = {r.joint: r for r in references() if r.joint.startswith("ring") and r.end == "largest"}
    counted = [r.also.degrees for r in ring.values() if r.also]
    assert (counted, sum(counted)) == ([85, 110, 65], 260)
    assert [r.judged.degrees for r in ring.values()] == [85, 100, 65]
    assert [r.other.degrees for r in ring.values() if r.other] == [90, 110, 80]


def test_the_smallest_change_that_counts_names_its_source() -> None:
    assert smallest_change().value == 12
    assert smallest_change().source.name == "Reissner 2019"
    assert smallest_change_of_rate().value == pytest.approx(
        1.96 * 2**0.5 * 0.46, abs=0.02
    )  # from the SD that its source names
    assert "0.46 Hz" in smallest_change_of_rate().source.reference
