"""Angles are said in clinical words, never with a bare sign."""

import math

import pytest

from handscope.app.language import ENGLISH
from handscope.app.report.change_words import value_words
from handscope.app.report.units import signed
from handscope.app.report.words import (
    SIDES,
    both_ways,
    extension_words,
    flexion_words,
    joint_words,
    span_words,
)
from tests.app.report.simulated_sessions import report


@pytest.mark.parametrize(
    ("joint", "smallest", "largest", "words"),
    [
        ("index_pip", 12, 90, "12° extension deficit"),
        ("index_mcp", -8, 90, "8° hyperextension"),
        ("index_dip", 0.3, 70, "full"),
        ("index_dip", -0.3, 70, "full"),
        ("index_pip", -13, -5, "5° to 13° hyperextension"),
        ("wrist", -45, 50, "45°"),
        ("wrist", 0, 50, "0°"),
        ("wrist", 10, 50, "10° extension deficit"),
        ("thumb_cmc", 9, 50, "9° short of palm"),
        ("thumb_cmc", -6, 50, "6° behind palm"),
        ("thumb_cmc", 0, 50, "to palm plane"),
    ],
)
def test_extension_is_a_deficit_or_beyond_straight(
    joint: str, smallest: float, largest: float, words: str
) -> None:
    assert extension_words(joint, math.radians(smallest), math.radians(largest), ENGLISH) == words


def test_a_task_that_did_not_ask_for_full_extension_shows_no_deficit() -> None:
    assert (
        extension_words("index_pip", math.radians(28), math.radians(90), ENGLISH, full=False)
        == "not below 28°"
    )


@pytest.mark.parametrize(("largest", "words"), [(95.4, "95°"), (-0.2, "0°"), (-5, "none")])
def test_flexion_is_the_largest_angle(largest: float, words: str) -> None:
    assert flexion_words(math.radians(largest), ENGLISH) == words


@pytest.mark.parametrize(
    ("joint", "smallest", "largest", "words"),
    [
        ("index_mcp", -17, 12, "17° abd., 12° add."),  # radial is away from the middle finger
        ("little_mcp", -12, 40, "40° abd., 12° add."),  # ulnar is
        ("middle_mcp", -3, 4, "3° radial, 4° ulnar"),
        ("wrist", -15, 25, "15° radial, 25° ulnar"),
        ("wrist", 5, 25, "5° to 25° ulnar"),
        ("wrist", -15, -6, "6° to 15° radial"),
        ("wrist", -15.2, -14.9, "15° radial"),
        ("thumb_cmc", -60, 10, "60° radial abd., 10° add."),
    ],
)
def test_side_motion_names_both_directions(
    joint: str, smallest: float, largest: float, words: str
) -> None:
    assert both_ways(math.radians(smallest), math.radians(largest), SIDES[joint], ENGLISH) == words


@pytest.mark.parametrize(
    ("name", "value", "unit", "words"),
    [
        ("index_pip_flexion_max", 82.4, "deg", "82°"),
        ("index_pip_flexion_min", -8.0, "deg", "8° hyperextension"),
        ("index_mcp_deviation_min", -12.0, "deg", "12°"),
        ("wrist_deviation_max", 18.0, "deg", "18°"),
        ("wrist_deviation_max", -12.0, "deg", "12° radial"),  # its name says ulnar
        ("wrist_deviation_min", 3.0, "deg", "3° ulnar"),
        ("thumb_cmc_pronation_min", 60.0, "deg", "60° pronation"),
        ("radial_abduction", -5.0, "deg", "5° smaller"),
        ("tapping_decrement_slope", -0.56, "mm", "0.56 mm smaller"),
        ("pronation_supination_decrement_slope", 2.26, "deg", "2.26° larger"),
    ],
)
def test_a_value_of_the_course_has_no_bare_sign(
    name: str, value: float, unit: str, words: str
) -> None:
    assert value_words(name, value, unit, ENGLISH) == words


def test_joints_are_named_by_finger_and_joint() -> None:
    assert joint_words("index_pip", ENGLISH) == ("Index", "PIP")
    assert joint_words("wrist", ENGLISH) == ("Wrist", "")


def test_the_span_of_tasks_names_each_and_its_seconds() -> None:
    tasks = report().tasks
    assert span_words(tasks[:1], ENGLISH) == "Fist and stretch, 7 to 20 s of the recording"
    assert (
        span_words([tasks[0], tasks[0]], ENGLISH)
        == "Fist and stretch, 7 to 20 and 7 to 20 s of the recording"
    )
    ranges = [t for t in tasks if t.result.measure == "range_of_motion"]
    assert span_words(ranges[:4], ENGLISH).startswith(
        "Fist and stretch; Spread and close; Thumb across and away; Wrist"
    )


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("tapping_fatigue50", -0.05, "0.05 s slower"),  # the first intervals less the last
        ("open_close_fatigue10", 0.05, "0.05 s faster"),
        ("tapping_interval_slope", -0.02, "0.02 s shorter"),
        ("tapping_decrement_slope", 0.02, "0.02 s larger"),
        ("reach_lean", -0.02, "0.02 s smaller"),
        ("tapping_rate", 0.02, "0.02 s"),
        ("tapping_fatigue50", -0.001, "0.00 s"),
    ],
)
def test_a_sign_is_said_in_words(name: str, value: float, words: str) -> None:
    assert signed(name, value, 2, "s", ENGLISH) == words


def test_a_number_has_a_true_minus_sign() -> None:
    assert ENGLISH.number(-3.25, 1) == "−3.2"
