"""The result at one glance: value, other hand, norm and change in one tile; each joint's deficit as a level."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import pytest

from handscope.app.language import languages
from handscope.app.protocols import load_all
from handscope.app.report.change_words import value_words
from handscope.app.report.changes import Change, Changes
from handscope.app.report.content import Task
from handscope.app.report.progress.importance import WRIST, leading_ranges
from handscope.app.report.references import newest
from handscope.app.report.sections.other_measures import share_words
from handscope.app.report.sections.range_comparison import behind_reference
from handscope.app.report.units import READABLE
from handscope.app.results.headlines import finger_rows, headlines, joint_deficits
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.range_of_motion import Range
from handscope.sessions.clinic.references import Compared

LONG = ("index", "middle", "ring", "little")
EN, DE = (languages()[code] for code in ("en", "de"))
DEG = 3.141592653589793 / 180
MOMENT = datetime(2026, 11, 24, 10, 12, tzinfo=UTC)
RATE = Figure("tapping_rate", 2.4972, "Hz", "x", 0.0011, what="tapping_rate")


def other(name: str, value: float, unit: str, measure: str = "tapping") -> Compared:
    return Compared(1, 1, "right", MOMENT, "1", {(measure, "tapping", name): (value, unit)})


def test_a_tile_names_the_other_hands_session_the_norm_and_the_change() -> None:
    change = Change("tapping", "tapping", "tapping_rate", 0.4, "per s", 1.26, "published", ())
    (task,) = headlines(
        [("tapping", "tapping", RATE)],
        {"tapping": "Finger tapping"},
        EN,
        Changes(MOMENT, (change,)),
        other("tapping_rate", 3.0, "Hz"),
        None,
    )
    (tile,) = task["tiles"]
    assert (task["title"], tile["value"]) == ("Finger tapping", "2.50 per s")
    assert tile["against"][0] == "Right hand, 24 November 2026, 10:12 UTC: 3.00 per s"
    assert tile["against"][1].startswith("Reference value: 3.57 ± 0.87")
    assert (tile["change"], tile["beyond"]) == ("0.40 per s higher, within MDC", False)
    assert (tile["wanted"], tile["verdict"]) == ("more", "")
    assert (tile["sd"], tile["grade"]) == ("± 0.001 per s", "good")


def test_a_tile_of_several_trials_has_their_worst_signal_and_no_deviation_of_one() -> None:
    trials = [RATE, replace(RATE, grade="fair"), RATE]
    rows = [("tapping", "tapping", trial) for trial in trials]
    (task,) = headlines(rows, {}, EN, None, None, None)
    assert [(tile["sd"], tile["grade"]) for tile in task["tiles"]] == [("", "fair")]


@pytest.mark.parametrize(
    ("measure", "name", "si", "unit", "value", "words"),
    [
        ("tapping", "tapping_amplitude_mean", "m", "mm", 61.43, "61.4 mm"),
        ("tapping", "tapping_amplitude_mean", "m", "mm", 8.21, "8.2 mm"),
        ("finger_spread", "whole_spread", "rad", "deg", 8.4, "8°"),
        ("kapandji", "kapandji_score", "1", "", 7.0, "7"),
        ("tapping", "tapping_decrement_ratio", "1", "%", 12.34, "12.3 % larger"),
    ],
)
def test_a_tile_has_the_decimals_of_its_course_and_its_change(
    measure: str, name: str, si: str, unit: str, value: float, words: str
) -> None:
    figure = Figure(name, value / READABLE.get(si, ("", 100 if unit else 1))[1], si, "x", what=name)
    change = Change(measure, measure, name, value, unit, None, "none", ())
    (task,) = headlines(
        [(measure, measure, figure)], {}, EN, Changes(MOMENT, (change,)), None, None
    )
    (tile,) = task["tiles"]
    assert tile["value"] == value_words(name, value, unit, EN) == words
    assert tile["change"].startswith(words.split(" larger")[0])


@pytest.mark.parametrize(
    ("measure", "what", "unit", "value", "verdict"),
    [
        ("tapping", "tapping_rate", "per s", 1.5, "better"),
        ("tapping", "tapping_rate", "per s", -1.5, "worse"),
        ("reach", "reach_trunk_forward", "mm", -30.0, "better"),
        ("squeeze", "squeeze_depth", "mm", -30.0, ""),  # neither is known to be better
    ],
)
def test_a_change_beyond_measurement_error_is_said_to_be_better_or_worse(
    measure: str, what: str, unit: str, value: float, verdict: str
) -> None:
    change = Change(measure, measure, what, value, unit, 1.0, "published", ())
    figure = Figure(what, 2.0, "Hz" if unit == "per s" else "m", "x", what=what)
    found = headlines([(measure, measure, figure)], {}, EN, Changes(MOMENT, (change,)), None, None)
    assert found[0]["tiles"][0]["verdict"] == verdict


def test_a_fist_has_a_tile_for_each_long_fingers_total_motion() -> None:
    rows = [
        (
            "rom_fist",
            "total_active_motion",
            Figure(f"{finger}_tam", 4.0, "rad", "x", part=finger, what="tam"),
        )
        for finger in ("thumb", "index", "middle", "ring", "little")
    ]
    (task,) = headlines(rows, {}, EN, None, None, None)
    assert [tile["label"].split(":")[0] for tile in task["tiles"]] == [
        "Index", "Middle", "Ring", "Little",
    ]  # fmt: skip
    assert task["tiles"][0]["value"] == "229°"


def test_a_spread_has_a_tile_for_each_gap_and_the_whole() -> None:
    pairs = [(f"{a}_{b}", "spread") for a, b in pairwise(LONG)]
    rows = [
        (
            "rom_spread",
            "finger_spread",
            Figure(f"{part}_{what}", 0.3, "rad", "x", part=part, what=what),
        )
        for part, what in [*pairs, ("index_little", "whole_spread")]
    ]
    (task,) = headlines(rows, {}, EN, None, None, None)
    assert [tile["value"] for tile in task["tiles"]] == ["17°"] * 4
    assert task["tiles"][0]["against"] == ["Reference value: 17.2 ± 2.6°"]


@pytest.mark.parametrize(
    ("task", "names"),
    [
        ("rom_wrist", [*WRIST]),
        ("rom_wrist_deviation", ["wrist_deviation_max", "wrist_deviation_min"]),
        ("rom_thumb_ip", ["thumb_ip_flexion_max", "thumb_ip_flexion_min"]),
        ("prom_pip", [f"{finger}_pip_flexion_max" for finger in LONG]),
        ("tapping", []),
    ],
)
def test_a_task_of_ranges_alone_is_led_by_its_joint(task: str, names: list[str]) -> None:
    assert list(leading_ranges(load_all()[task])) == names


def test_a_wrist_has_tiles_with_its_directions_the_other_hand_and_more_is_better() -> None:
    measured = dict(zip(WRIST, (40.0, -35.0, 20.0, -15.0)))
    rows = [
        (task, "range_of_motion", Figure(name, v * DEG, "rad", "x", part="wrist", what=name[6:]))
        for task in ("rom_fist", "rom_wrist")
        for name, v in measured.items()
    ]
    change = Change("range_of_motion", "rom_wrist", WRIST[1], -14.0, "deg", 12.0, "published", ())
    theirs = Compared(
        1, 1, "right", MOMENT, "1",
        {("range_of_motion", "rom_wrist", WRIST[1]): (-62 * DEG, "rad")},
    )  # fmt: skip
    ranges = {task: leading_ranges(load_all()[task]) for task in ("rom_fist", "rom_wrist")}
    told = headlines(rows, {}, EN, Changes(MOMENT, (change,)), theirs, None, ranges)
    (tiles,) = (task["tiles"] for task in told if task["title"] == "rom_wrist")
    assert [tile["label"] for tile in tiles] == [
        "Wrist, flexion", "Wrist, extension", "Wrist, ulnar", "Wrist, radial",
    ]  # fmt: skip
    assert [tile["value"] for tile in tiles] == ["40°", "35°", "20°", "15°"]
    assert tiles[1]["against"] == [
        "Right hand, 24 November 2026, 10:12 UTC: 62°",
        "Reference value: 70°",
    ]
    assert tiles[1]["change"].startswith("14° more")
    assert (tiles[1]["wanted"], tiles[1]["verdict"]) == ("more", "better")


@pytest.mark.parametrize(
    ("value", "words"), [(-0.016, "1.6 % smaller"), (0.016, "1.6 % larger"), (-0.0004, "0.0 %")]
)
def test_a_value_below_zero_is_said_in_words_and_larger_is_better(value: float, words: str) -> None:
    ratio = Figure("tapping_decrement_ratio", value, "1", "x", what="tapping_decrement_ratio")
    (task,) = headlines([("tapping", "tapping", ratio)], {}, EN, None, None, None)
    (tile,) = task["tiles"]
    assert (tile["value"], tile["wanted"]) == (words, "larger")


def test_a_figure_that_was_not_measured_has_no_tile() -> None:
    lost = Figure("tapping_rate", float("nan"), "Hz", "x", what="tapping_rate")
    assert headlines([("tapping", "tapping", lost)], {}, EN, None, None, None) == []


@pytest.mark.parametrize(
    ("flexion", "level"), [(100, "none"), (88, "none"), (87, "small"), (75, "large")]
)
def test_a_joint_behind_the_reference_has_a_level(flexion: int, level: str) -> None:
    bent = Range("index_pip", "flexion", flexion * DEG, 0.0, 1.0, 2.0, "good", "")
    result = TaskResult("rom_fist", "range_of_motion", 0.0, 9.0, [bent], ())
    (joint,) = joint_deficits([Task(result, "Fist", "", None)], EN, None, None)
    assert (joint["joint"], joint["level"]) == ("index_pip", level)


@pytest.mark.parametrize(("flexion", "level"), [(61, "none"), (52, "small"), (40, "large")])
def test_a_joint_is_behind_only_where_it_is_behind_both_sources(flexion: int, level: str) -> None:
    bent = Range("ring_dip", "flexion", flexion * DEG, 0.0, 1.0, 2.0, "good", "")
    result = TaskResult("rom_fist", "range_of_motion", 0.0, 9.0, [bent], ())
    (joint,) = joint_deficits([Task(result, "Fist", "", None)], EN, None, None)
    assert (joint["level"], joint["reference"]) == (level, 65)
    against = "65° (ASSH; Electronic Textbook of Hand Surgery: 80°)"
    assert joint["words"] == f"Ring DIP: flexion {flexion}°, {65 - flexion}° behind {against}"


@pytest.mark.parametrize(("task", "joints"), [("rom_fist", []), ("rom_thumb", ["thumb_ip"])])
def test_a_fist_asks_not_all_of_a_thumbs_flexion(task: str, joints: list[str]) -> None:
    bent = Range("thumb_ip", "flexion", 41 * DEG, 0.0, 1.0, 2.0, "good", "")
    tasks = [Task(TaskResult(task, "range_of_motion", 0.0, 9.0, [bent], ()), "", "", None)]
    assert [j["joint"] for j in joint_deficits(tasks, EN, None, None)] == joints
    assert {gap.joint for gap in behind_reference(tasks, newest())} == {*joints}
    theirs = other("thumb_ip_flexion_max", 80 * DEG, "rad", "range_of_motion")
    assert [j["level"] for j in joint_deficits(tasks, EN, theirs, None)] == ["large"]


def test_the_other_hand_comes_before_the_reference() -> None:
    bent = Range("index_pip", "flexion", 90 * DEG, 0.0, 1.0, 2.0, "good", "")
    result = TaskResult("rom_fist", "range_of_motion", 0.0, 9.0, [bent], ())
    theirs = other("index_pip_flexion_max", 130 * DEG, "rad", "range_of_motion")
    (joint,) = joint_deficits([Task(result, "Fist", "", None)], DE, theirs, None)
    assert joint["level"] == "large"
    assert joint["words"] == "Zeigefinger PIP: Beugung 90°, 40° hinter 130°"


def test_a_bar_has_both_hands_ranges_and_the_reference() -> None:
    bent = Range("index_pip", "flexion", 90 * DEG, 4 * DEG, 1.0, 2.0, "good", "")
    result = TaskResult("rom_fist", "range_of_motion", 0.0, 9.0, [bent], ())
    ends = {"max": 98 * DEG, "min": 1 * DEG}
    key = "range_of_motion", "rom_fist"
    theirs = Compared(
        1, 1, "right", MOMENT, "1",
        {(*key, f"index_pip_flexion_{end}"): (value, "rad") for end, value in ends.items()},
    )  # fmt: skip
    (both,) = joint_deficits([Task(result, "Fist", "", None)], EN, theirs, None)
    (alone,) = joint_deficits([Task(result, "Fist", "", None)], EN, None, None)
    assert (both["other"], alone["other"]) == ([1, 98], None)
    assert alone["reference"] == 100 and alone["name"] == "Index PIP"
    assert sorted(alone["range"]) == [4, 90]


@pytest.mark.parametrize(
    ("deficit", "words"),
    [(0.3, "227°"), (18.0, "227°, less extension deficit: PIP 18°")],
)
def test_a_fingers_tam_names_the_deficits_that_it_has_subtracted(
    deficit: float, words: str
) -> None:
    figures = (
        Figure("index_tam", 227 * DEG, "rad", "x", part="index", what="tam"),
        Figure("index_tam_share", 0.87, "1", "x", part="index", what="tam_share"),
        Figure(
            "index_pip_extension_deficit",
            deficit * DEG,
            "rad",
            "x",
            part="index_pip",
            what="extension_deficit",
            detail=True,
        ),
    )
    result = TaskResult("rom_fist", "total_active_motion", 0, 1, None, figures)
    section = {"measure": "total_active_motion", "name": "rom_fist"}
    ((_, tam, *_),) = finger_rows(section, [Task(result, "", "", None)], EN, None)
    assert tam == words


@pytest.mark.parametrize(
    ("finger", "category", "words"),
    [
        (
            "index",
            "good",
            "against 260° (norm)",
        ),
        ("thumb", "good", "against 140° (norm)"),
        (
            "thumb",
            "",
            "against 140° (norm); not graded, as the task does not ask for all of the thumb’s flexion",
        ),
    ],
)
def test_a_share_says_of_what_norm_it_is_and_why_a_thumb_has_no_word(
    finger: str, category: str, words: str
) -> None:
    share = Figure(
        f"{finger}_tam_share", 0.6, "1", "x", part=finger, what="tam_share", category=category
    )
    task = Task(TaskResult("rom_fist", "total_active_motion", 0, 1, None, (share,)), "", "", None)
    assert share_words(share, task, EN) == words
