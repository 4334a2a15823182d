"""What self-calibration found stands in words, millimetres and degrees in the report, with its standard deviations."""

from dataclasses import replace
from typing import Any

from handscope.app.language import languages
from handscope.app.report import FORMS, Style
from handscope.app.report.sections.self_calibration import (
    describe,
    found_calibration,
    section,
    with_deviation,
)
from handscope.app.report.stored import pack, unpack
from handscope.estimators.messages.sentence import phrase
from tests.app.report.simulated_sessions import report
from tests.sessions.clinic.test_self_calibrations import found
from tests.simulated import calibrated, pose_and_wiggle

ENGLISH, GERMAN = languages()["en"], languages()["de"]
UNSEEN = phrase("self_calibration.found_no_length", segment="index_middle", length=23.7, sd=4.0)


def kept() -> dict[str, Any]:
    one = found()
    seats = {**one.table["sensor_to_segment"]}
    seats["index_proximal"] = {
        **seats["index_proximal"],
        "p_BS": [0.0031, 0.0204, -0.0008],
        "p_BS_sd": [0.0004, 0.00025, 0.0011],
    }
    biases = {
        "acc_bias": {"index_proximal": [0.03, 0.0, 0.04]},
        "acc_bias_sd": {"index_proximal": [0.002, 0.002, 0.003]},
    }
    return {
        "table": {**one.table, "sensor_to_segment": seats, **biases},
        "told": [UNSEEN],
        "onset": 0.0,
        "end": 40.0,
        "parts": "lengths_and_seats",
    }


def test_lengths_places_and_biases_are_told_with_their_standard_deviations() -> None:
    said = describe(kept()["table"], [UNSEEN], ENGLISH)
    assert said["summary"] == "1 of 10 lengths found, the worst of them to 0.20 mm"
    assert ["index proximal", "43.00 ± 0.20", "found by the movement"] in said["lengths"]
    assert ["index middle", "23.7", "from the hand’s measures"] in said["lengths"]
    assert said["seats"] == [
        ["index proximal", "20.40 ± 0.25", "3.10 ± 0.40", "−0.8 ± 1.1", "11.46 ± 0.50"]
    ]
    (bias,) = said["biases"]
    assert (bias[0], bias[2]) == ("index proximal", "0.050 ± 0.003")


def test_it_is_kept_with_the_stretch_of_movement_that_told_it() -> None:
    moved = replace(
        calibrated(pose_and_wiggle("left")),
        lengths_sd={"index_proximal": 2e-4},
        stretch=(3.5, 43.5),
    )
    one = found_calibration(moved, ())
    assert one is not None and (one.onset, one.end) == (3.5, 43.5)


def test_it_is_told_in_german() -> None:
    said = describe(kept()["table"], [UNSEEN], GERMAN)
    assert "lässt sich nicht bestimmen (24 mm" in said["words"][0]
    assert any(
        row[1:] == ["43,00 ± 0,20", "durch die Bewegung gefunden"] for row in said["lengths"]
    )


def test_a_report_of_it_has_a_section_and_one_of_a_pose_has_none() -> None:
    whole = report()
    assert whole.self_calibration is None and section(None, ENGLISH) is None
    again = unpack(pack(replace(whole, self_calibration=kept())))
    assert again is not None and again.self_calibration == kept()
    page = FORMS["html"](again, Style(ENGLISH)).decode()
    assert "Where and how the sensors sit" in page and "43.00 ± 0.20" in page
    assert "Where and how the sensors sit" not in FORMS["html"](whole, Style(ENGLISH)).decode()
    lengths = section({**kept(), "parts": "lengths"}, ENGLISH)
    assert lengths is not None and [part["title"] for part in lengths["parts"]] == ["Lengths"]
    assert FORMS["pdf"](again, Style(GERMAN)).startswith(b"%PDF")


def test_a_deviation_is_told_in_two_digits_and_never_as_nothing() -> None:
    assert with_deviation(44.214, 0.1312, ENGLISH) == "44.21 ± 0.13"
    assert with_deviation(44.214, 1e-7, ENGLISH) == "44.214 ± 0.001"
    assert with_deviation(44.214, None, GERMAN) == "44,2"
