"""Total active motion of known fists, and the gradings at their bounds."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FLEXION, JOINT, JOINTS, SEGMENT
from handscope.estimators.measures import range_of_motion, total_active_motion
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.measures.total_active_motion import (
    FingerMotion,
    Params,
    grade_with_scheme,
    strickland,
)
from tests.estimators.measures.trajectories import by_name, made

DEG = np.pi / 180


def _fist(
    bent: tuple[float, ...], straight: tuple[float, ...], finger: str = "index"
) -> Trajectory:
    """A second stretched, a second in a fist, joined by half a second: MCP, PIP, DIP in deg."""
    joints = [j.name for j in JOINTS if j.name.startswith(finger) and j.name != "thumb_cmc"]
    weight = np.interp(np.arange(400) / 100, [1, 1.5, 2.5, 3], [0, 1, 1, 0])
    angles = np.full((400, len(JOINTS), 3), np.nan)
    for joint, high, low in zip(joints, bent, straight):
        angles[:, JOINT[joint], FLEXION] = DEG * (low + (high - low) * weight)
    return replace(made(400, angles), angles_sd=np.full((400, len(JOINTS), 3), 2 * DEG))


def _fists(extensions: dict[str, float], fist: float = 80.0) -> Trajectory:
    """A second flat as in the calibration, then fists and stretches of a second each, twice; joint by what flexion is left when stretched, deg."""
    angles = np.full((700, len(JOINTS), 3), np.nan)
    weight = np.interp(
        np.arange(700) / 100, [1, 1.5, 2.5, 3, 4, 4.5, 5.5, 6], [0, 1, 1, 0, 0, 1, 1, 0]
    )
    late = np.arange(700) >= 200
    for joint, left in extensions.items():
        low = np.where(late, left, 0.0)
        angles[:, JOINT[joint], FLEXION] = DEG * (low + (fist - low) * weight)
    return made(700, angles)


FIST = TaskRequest("rom_fist")
LAG = {"index_mcp": -5.0, "index_pip": 22.0, "index_dip": 6.0}


def test_the_posture_before_the_first_fist_is_no_stretch_of_the_trial() -> None:
    (found,) = total_active_motion.measure(Params(), _fists(LAG), 0, 7, asked=FIST)
    assert found.deficits == pytest.approx(
        {"index_mcp": 0.0, "index_pip": 22 * DEG, "index_dip": 6 * DEG}
    )
    assert found.tam == pytest.approx((240 - 28) * DEG)
    assert found.t_stretch > 2.5


def test_the_table_of_ranges_has_the_extension_that_tam_subtracts() -> None:
    (tam,) = total_active_motion.measure(Params(), _fists(LAG), 0, 7, asked=FIST)
    ranges = range_of_motion.measure(range_of_motion.Params(), _fists(LAG), 0, 7, asked=FIST)
    assert {r.joint: r.smallest for r in ranges} == dict(tam.extensions)
    assert {r.t_smallest for r in ranges} == {tam.t_stretch}


def test_a_finger_without_all_its_joints_has_the_extension_of_the_stretches_too() -> None:
    moved = _fists({"index_pip": 22.0})
    (found,) = range_of_motion.measure(range_of_motion.Params(), moved, 0, 7, asked=FIST)
    assert found.smallest == pytest.approx(22 * DEG)


def test_a_finger_that_stays_locked_in_the_fist_has_its_deficit() -> None:
    """The middle finger stays at 75 deg a joint while the index finger opens."""
    locked = {f"middle_{j}": 75.0 for j in ("mcp", "pip", "dip")}
    moved = _fists(dict.fromkeys(LAG, 0.0) | locked)
    _, middle = total_active_motion.measure(Params(), moved, 0, 7, asked=FIST)
    assert middle.tam == pytest.approx(15 * DEG)


def test_a_trial_that_ends_in_its_first_fist_has_the_extension_that_it_began_with() -> None:
    (found,) = total_active_motion.measure(Params(), _fists(LAG), 0, 1.9, asked=FIST)
    assert found.deficits == dict.fromkeys(LAG, 0.0)


def test_a_cued_task_has_its_extension_from_the_first_stretch_asked_for() -> None:
    marks = tuple(
        Mark(t, t + 1.5, phase)
        for t, phase in ((1, "flexion"), (2.5, "extension"), (4, "flexion"), (5.5, "extension"))
    )
    (found,) = range_of_motion.measure(
        range_of_motion.Params(),
        _fists({"index_pip": 22.0}),
        0,
        7,
        asked=TaskRequest("rom_pip", marks=marks),
    )
    assert found.smallest == pytest.approx(22 * DEG)
    assert found.largest == pytest.approx(80 * DEG)


def test_a_task_that_says_nothing_of_extension_has_all_of_its_range() -> None:
    (found,) = range_of_motion.measure(
        range_of_motion.Params(), _fists({"wrist": 22.0}), 0, 7, asked=TaskRequest("rom_wrist")
    )
    assert found.smallest == 0


def _motion(tam: float, finger: str = "index", **changes: float) -> FingerMotion:
    """A finger of that TAM in deg, all of it in the PIP joint (thumb: MCP)."""
    joint = "thumb_mcp" if finger == "thumb" else f"{finger}_pip"
    return FingerMotion(
        finger, {joint: tam * DEG}, {joint: 0.0}, {}, {}, 0.0, 1.0, "good", "", **changes
    )  # type: ignore[arg-type]


def test_tam_is_the_fist_less_the_deficits_and_hyperextension_counts_as_zero() -> None:
    """85 + 100 + 60, with 10 deg of deficit at the PIP joint and 12 of hyperextension at the MCP joint."""
    f = by_name(
        total_active_motion.figures(
            total_active_motion.measure(Params(), _fist((85, 100, 60), (-12, 10, 0)), 0, 4)
        )
    )
    assert f["index_taf"].value == pytest.approx(245 * DEG)
    assert f["index_tam"].value == pytest.approx(235 * DEG)
    assert f["index_tam_share"].value == pytest.approx(235 / 260)
    assert f["index_tam_share"].category == "good"
    assert f["index_pip_extension_deficit"].value == pytest.approx(10 * DEG)
    assert f["index_mcp_extension_deficit"].value == 0
    assert f["index_mcp_hyperextension"].value == pytest.approx(12 * DEG)
    assert f["index_taf"].sd == pytest.approx(np.sqrt(3) * 2 * DEG)
    assert f["index_tam"].sd == pytest.approx(
        np.sqrt(5) * 2 * DEG
    )  # three flexions, and the two joints that may have a deficit


def test_joints_that_bend_one_after_the_other_have_no_composite_fist() -> None:
    """90 deg each, never together: TAF is 90, not 270."""
    angles = np.full((600, len(JOINTS), 3), np.nan)
    for k, joint in enumerate(("index_mcp", "index_pip", "index_dip")):
        angles[:, JOINT[joint], FLEXION] = np.interp(
            np.arange(600) / 100, [2 * k, 2 * k + 1, 2 * k + 2], [0, 90 * DEG, 0]
        )
    (found,) = total_active_motion.measure(Params(), made(600, angles), 0, 6)
    assert found.taf == pytest.approx(90 * DEG, abs=6 * DEG)


def test_a_finger_without_all_its_joints_has_no_tam_and_flags_lower_the_grade() -> None:
    moved = _fist((85, 100, 60), (0, 0, 0))
    moved.angles[:, JOINT["index_dip"]] = np.nan
    assert total_active_motion.measure(Params(), moved, 0, 4) == []
    moved = _fist((85, 100, 60), (0, 0, 0))
    moved.flags[:40, SEGMENT["index_middle"]] = Flag.MISSING
    (found,) = total_active_motion.measure(Params(), moved, 0, 4)
    assert (found.grade, found.reason) == (
        "fair",
        "samples missing and bridged in 10 % of the samples",
    )


@pytest.mark.parametrize(
    ("scheme", "finger", "tam", "word"),
    [
        ("assh", "index", 260, "excellent"),
        ("assh", "index", 258, "good"),
        ("assh", "index", 195, "fair"),
        ("assh", "index", 130, "poor"),
        ("eatonhand", "index", 221, "excellent"),
        ("eatonhand", "index", 182, "good"),
        ("eatonhand", "index", 130, "fair"),
        ("eatonhand", "index", 128, "poor"),
        ("eatonhand_degrees", "little", 220, "excellent"),
        ("eatonhand_degrees", "little", 219, "good"),
        ("eatonhand_degrees", "little", 130, "fair"),
        ("eatonhand_degrees", "little", 129, "poor"),
        ("eatonhand_degrees", "thumb", 119, "excellent"),
        ("eatonhand_degrees", "thumb", 97, "fair"),
        ("eatonhand_degrees", "thumb", 69, "poor"),
        ("strickland", "index", 149, "excellent"),  # of the PIP and DIP joints alone
        ("strickland", "index", 88, "fair"),
        ("strickland", "index", 86, "poor"),
        ("strickland", "thumb", 100, ""),
        ("burn", "index", 260, "normal"),
        ("burn", "index", 220, "excellent"),
        ("burn", "index", 180, "good"),
        ("burn", "index", 179, "poor"),
    ],
)
def test_every_grading_has_its_published_bounds(
    scheme: str, finger: str, tam: float, word: str
) -> None:
    assert grade_with_scheme(scheme, _motion(tam, finger)) == word


def test_the_uninjured_hand_is_the_norm_where_it_is_known() -> None:
    assert grade_with_scheme("assh", _motion(200)) == "good"
    assert grade_with_scheme("assh", _motion(200), other_hand=200 * DEG) == "excellent"
    assert grade_with_scheme("assh", _motion(200), other_hand=280 * DEG) == "fair"


def test_strickland_leaves_the_mcp_joint_out() -> None:
    flexions = {"index_mcp": 90 * DEG, "index_pip": 100 * DEG, "index_dip": 60 * DEG}
    left = {"index_mcp": 20 * DEG, "index_pip": 15 * DEG, "index_dip": -5 * DEG}
    assert strickland(
        FingerMotion("index", flexions, left, {}, {}, 0.0, 1.0, "good", "")
    ) == pytest.approx(145 / 175)


def test_an_unknown_grading_is_refused() -> None:
    with pytest.raises(InputError, match="gradings are assh"):
        grade_with_scheme("buck_gramcko", _motion(200))


@pytest.mark.parametrize(
    ("asked", "word"), [(FIST, ""), (TaskRequest("tam", {"fingers": ["thumb"]}), "poor")]
)
def test_a_thumb_is_graded_only_where_the_task_asks_for_it(asked: TaskRequest, word: str) -> None:
    """A fist bends the long fingers as far as they go, the thumb as far as it has room."""
    moved = _fist((30, 30), (0, 0), "thumb")
    figures = total_active_motion.figures(
        total_active_motion.measure(Params(), moved, 0, 4, asked=asked)
    )
    (share,) = [f for f in figures if f.name == "thumb_tam_share"]
    assert (share.value, share.category) == (pytest.approx(60 / 140), word)
    (again,) = [
        f for f in total_active_motion.regrade(figures, "eatonhand") if f.name == share.name
    ]
    assert again.category == word
