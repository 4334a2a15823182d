"""Recordings that are right: each is put through every check, and a bound stands beside the count."""

import pytest

from handscope.validation.reproduce import Wanted
from handscope.validation.studies import false_alarms
from handscope.validation.studies.false_alarms import Answer, Trial, at_most


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["outside: open and close", "outside: drumming", "tapping"])
def test_nothing_is_said_of_a_recording_that_is_right(kind: str) -> None:
    assert false_alarms.measure(Trial(kind, 2)) == Answer((), ())


def test_the_bound_is_that_of_no_alarm_in_so_many_recordings() -> None:
    assert at_most(0, 600) == pytest.approx(1 - 0.05 ** (1 / 600))
    assert at_most(3, 3) == 1.0


def test_alarms_and_questions_are_counted_by_recording() -> None:
    results = [
        (Trial("tapping", 0), Answer((), ())),
        (Trial("tapping", 1), Answer(("sensors.late", "sensor.slipped"), ("person.bone_length",))),
    ]
    found = false_alarms.finding(Wanted(), results)
    (row,) = found.tables[0].rows
    assert [row.ours[c].mean for c in found.tables[0].columns] == [2, 1, 1]
    assert not found.verdicts[0].met
    assert any(
        "person 1: sensors.late, sensor.slipped, person.bone_length" in r for r in found.remarks
    )


@pytest.mark.parametrize(("recordings", "is_shown"), [(590, False), (610, True)])
def test_the_target_is_met_only_where_the_bound_shows_it(recordings: int, is_shown: bool) -> None:
    results = [(Trial("tapping", seed), Answer((), ())) for seed in range(recordings)]
    (verdict,) = false_alarms.finding(Wanted(), results).verdicts
    assert verdict.met == is_shown
