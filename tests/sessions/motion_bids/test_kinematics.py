"""Movements that other systems tell: our derivative comes back as it was, angles, orientations and markers of any unit are taken."""

import json
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import JOINT
from handscope.estimators.numerics.typing import Array
from handscope.sessions.motion_bids import kinematics
from handscope.sessions.motion_bids.kinematics import Kinematics
from handscope.sessions.tables_io.trajectory_table import channels_of, table_of
from tests.simulated import DEG, pose_and_wiggle, tracked

Column = tuple[
    str, str, str, str, str, Array
]  # name, component, type, tracked point, units, values


def table(
    folder: Path,
    columns: list[Column],
    name: str = "sub-01_task-x_tracksys-optical",
    **sidecar: object,
) -> Path:
    """One table of a dataset; returns the dataset's folder."""
    place = folder / "sub-01" / "motion"
    place.mkdir(parents=True, exist_ok=True)
    lines = ["name\tcomponent\ttype\ttracked_point\tunits", *("\t".join(c[:5]) for c in columns)]
    (place / f"{name}_channels.tsv").write_text("\n".join(lines) + "\n")
    np.savetxt(
        place / f"{name}_motion.tsv", np.column_stack([c[5] for c in columns]), delimiter="\t"
    )
    (place / f"{name}_motion.json").write_text(
        json.dumps({"TaskName": "x", "SamplingFrequency": 50.0, **sidecar})
    )
    return folder


def opened(path: Path, hand: object = None) -> Kinematics:
    files, tables, inertial = kinematics.tables_at(path)
    assert not inertial
    assert len(tables) == 1
    return kinematics.load(files, tables[0], hand)  # type: ignore[arg-type]


def orientation(segment: str, q: Array) -> list[Column]:
    return [
        (f"{segment}_{c}", f"quat_{c}", "ORNT", segment, "n/a", q[:, k])
        for k, c in enumerate("wxyz")
    ]


def test_our_derivative_comes_back_as_it_was(tmp_path: Path) -> None:
    moved = tracked(pose_and_wiggle("right"))
    columns, numbers = table_of(moved)
    place = tmp_path / "sub-01" / "motion"
    place.mkdir(parents=True)
    base = place / "sub-01_task-x_tracksys-handscope_desc-m2"
    base.with_name(base.name + "_motion.tsv").write_bytes(bytes(numbers))
    base.with_name(base.name + "_channels.tsv").write_bytes(channels_of(columns))
    base.with_name(base.name + "_motion.json").write_text(
        json.dumps({"MeasuredHand": "right", "SamplingFrequency": 100})
    )
    back = opened(tmp_path)
    assert back.trajectory is not None
    assert (back.hand, back.has_angles, back.trajectory.hand) == ("right", True, "right")
    np.testing.assert_array_equal(back.trajectory.t, moved.t)
    np.testing.assert_array_equal(back.trajectory.angles, moved.angles)
    np.testing.assert_array_equal(back.trajectory.tips, moved.tips)
    np.testing.assert_array_equal(back.trajectory.flags, moved.flags)
    np.testing.assert_allclose(
        back.trajectory.q_GS, moved.q_GS, atol=1e-15
    )  # norms are made one again


def test_orientations_give_joint_angles_and_keep_all_three(tmp_path: Path) -> None:
    angles = np.random.default_rng(0).uniform(-1, 1, (40, 3))
    proximal, middle = np.tile([1.0, 0, 0, 0], (40, 1)), joint_angles.compose(angles)
    table(
        tmp_path,
        orientation("index_proximal", proximal) + orientation("index_middle", middle),
        MeasuredHand="left",
    )
    found = opened(tmp_path)
    assert found.trajectory is not None
    assert not found.has_angles
    np.testing.assert_allclose(found.trajectory.angles[:, JOINT["index_pip"]], angles, atol=1e-12)
    np.testing.assert_allclose(np.diff(found.trajectory.t), 0.02)


def test_degrees_and_millimetres_are_converted(tmp_path: Path) -> None:
    values = np.linspace(0, 90, 30)
    columns: list[Column] = [("index_pip_flexion", "n/a", "JNTANG", "index_pip", "deg", values)]
    columns += [(f"thumb_tip_{c}", c, "POS", "thumb_tip", "mm", values) for c in "xyz"]
    found = opened(table(tmp_path, columns))
    assert found.trajectory is not None
    assert found.hand is None
    np.testing.assert_allclose(found.trajectory.angles[:, JOINT["index_pip"], 0], values * DEG)
    np.testing.assert_allclose(found.trajectory.tips[:, 0, 0], values * 1e-3)


def test_markers_are_told_apart_from_tips(tmp_path: Path) -> None:
    values = np.arange(30.0)
    names = ("index_middle_1", "index_middle_2", "index_tip")
    found = opened(
        table(
            tmp_path,
            [
                (f"{n}_{c}", c, "POS", n, "mm", values + k)
                for n in names
                for k, c in enumerate("xyz")
            ],
        )
    )
    assert found.trajectory is None
    assert found.markers is not None
    assert found.markers.names == names
    np.testing.assert_allclose(found.markers.places[:, 1, 2], (values + 2) * 1e-3)


@pytest.mark.parametrize(
    ("column", "sentence"),
    [
        (
            ("index_pip_flexion", "n/a", "JNTANG", "index_pip", "grad", np.ones(9)),
            "unknown unit 'grad'; JNTANG is given in rad, deg",
        ),
        (
            ("index_tip_x", "x", "POS", "index_tip", "inch", np.ones(9)),
            "unknown unit 'inch'; POS is given in m",
        ),
        (
            ("q", "quat_w", "ORNT", "index_middle", "n/a", np.ones(9)),
            "has not all of quat_w, quat_x, quat_y, quat_z",
        ),
        (("index_pip_flexion", "n/a", "JNTANG", "index_pip", "rad", np.ones(1)), "has 1 sample;"),
    ],
)
def test_tables_that_cannot_be_read_are_refused(
    tmp_path: Path, column: Column, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        opened(table(tmp_path, [column]))


def test_a_quaternion_of_another_length_and_the_other_hand_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no unit quaternion"):
        opened(table(tmp_path, orientation("index_middle", np.ones((9, 4)))))
    with pytest.raises(InputError, match="was recorded on the left hand, not on the right one"):
        opened(
            table(
                tmp_path,
                orientation("index_middle", np.tile([1.0, 0, 0, 0], (9, 1))),
                MeasuredHand="left",
            ),
            "right",
        )
