"""The table of faults: what is put in is found, what is right raises no alarm, and sizes are read off right."""

import pytest

from handscope.validation.reproduce import Wanted
from handscope.validation.studies import fault_table
from handscope.validation.studies.fault_table import Found, Trial


@pytest.fixture(scope="module")
def measured() -> Found:
    return fault_table.measure(Trial("fist and flat hand", 0))


@pytest.mark.slow
def test_a_recording_without_a_fault_raises_no_alarm(measured):
    assert measured.alarms == ()


@pytest.mark.slow
def test_faults_of_all_sensors_are_found_and_named(measured):
    for fault in ("all gyroscopes negated", "all gyroscopes in deg/s", "all accelerometers in g"):
        assert measured.found[fault, 1.0] and measured.named[fault, 1.0], fault


def test_the_size_that_half_and_nearly_all_find_lies_between_those_tried():
    results = [
        (Trial("tapping", k), _found({1.1: k == 0, 1.2: k < 3, 1.3: True})) for k in range(4)
    ]
    (row,) = fault_table.finding(Wanted(), results).tables[1].rows
    assert row.ours["half of all, tasks"].mean == pytest.approx(1.15)
    assert row.ours["95 %, tasks"].mean == pytest.approx(1.28)


def test_it_is_counted_how_often_a_named_cause_is_right():
    found = {("gain", size): True for size in (1.1, 1.2, 1.3, 1.5, 2.0)} | {("gain", 1.05): False}
    named = {key: key[1] in (1.3, 1.5, 2.0) for key in found}
    wrong = {key: key[1] == 1.2 for key in found}
    results = [(Trial("tapping", 0), Found((), found, named, wrong))]
    (said, *_) = fault_table.finding(Wanted(), results).remarks
    assert said == (
        "Of 5 faults found the cause is named in 4, and right in 75 % of these; in 1 it is left open."
    )


def test_false_alarms_are_counted_by_recording():
    quiet, loud = _found({1.1: True}), _found({1.1: True}, ("sensor.gyroscope_gain", "file.rate"))
    verdict = fault_table.finding(
        Wanted(), [(Trial("tapping", 0), quiet), (Trial("tapping", 1), loud)]
    ).verdicts[0]
    assert verdict.value == 0.5 and not verdict.met


def _found(sizes: dict[float, bool], alarms: tuple[str, ...] = ()) -> Found:
    by_size = {("gain", size): found for size, found in sizes.items()} | {("gain", 2.0): True}
    return Found(alarms, by_size, by_size, dict.fromkeys(by_size, False))
