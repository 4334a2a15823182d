"""What is refused, warned of and found is said in every language, as far as a person with a browser can meet it."""

import re
from functools import cache

import pytest

from handscope.app.language import ENGLISH, NAME, Language, _to_pattern, languages
from tests.app.language.sentences import Sentence, sentences

OTHERS = [one for one in languages().values() if one is not ENGLISH]
COMMAND_LINE = (
    *(
        "app/analysis",
        "app/exporting/cohort.py",
        "app/commands",
        "app/exporting/fhir_server.py",
        "app/exporting/saving.py",
        "app/devices/force_strip.py",
        "app/devices/strip_flash.py",
        "app/devices/virtual_glove",
        "app/metrics.py",
    ),
    *(
        "sessions/formats/qualisys.py",
        "validation",
        "sessions/tables_io/array_description.py",
        "sessions/tables_io/array_cells.py",
        "sessions/tables_io/array_table.py",
        "sessions/store/backup.py",
        "sessions/store/archive_entries.py",
        "sessions/store/sealed_files.py",
        "sessions/formats/c3d.py",
        "sessions/formats/landmarks.py",
        "sessions/tables_io/calibration_result.py",
    ),
    *(
        "sessions/store/database.py",
        "sessions/store/database_dump.py",
        "estimators/sensors/magnetometer_ellipsoid.py",
    ),
    *(
        "estimators/magnet/array/bench_readings.py",
        "estimators/magnet/pipeline/setup_learning.py",
        "estimators/pipeline/optical_trajectory.py",
        "estimators/pipeline/landmark_trajectory.py",
        "estimators/measures/synchronisation.py",
        "estimators/measures/tip_errors.py",
    ),
    *(
        "estimators/force/sensor.py",
        "estimators/simulation",
        "estimators/sensors/six_position_calibration.py",
        "sessions/formats/load_table.py",
        "sessions/table_import",
    ),
)
PROGRAMMERS = (
    "app/analysis",  # the front door for notebooks
    "app/live/outputs/client.py",
    *(
        "app/workers/process.py",
        "sessions/files/frames.py",
        "estimators/magnet/array/localisation.py",
        "estimators/magnet/tracker/tracker.py",
        "estimators/measures/signals.py",
    ),
    *(
        "estimators/measures/independence.py",
        "estimators/measures/repeatability.py",
        "estimators/measures/smoothness.py",
    ),
    *("estimators/measures/tapping.py", "estimators/measures/tremor.py"),
)
NOT_SO = {  # pieces that are never told by themselves
    "{what} was changed in another window meanwhile; compare with what is stored now and choose",  # said of four things, each by itself
    "{where} is missing{_and_more(more)}",  # said with and without the others' number
    "functional calibration; what the others tell serves instead",  # only with the steps between
}


def told(one: Language, said: Sentence) -> bool:
    """Whether the language has the sentence whole: neither a part of it that happens to be known nor a frame such as "{sensor}: {sentence}" counts."""
    example = said.example()
    fits = (s for s, gapped in worded(one) if gapped.fullmatch(example))
    return (example in one.sentences or next(fits, None) is not None) and one.translate(
        example
    ) != example


@cache
def worded(one: Language) -> list[tuple[str, re.Pattern[str]]]:
    """The sentences with gaps that have words of their own between them."""
    return [
        (s, re.compile(_to_pattern(s)))
        for s in one.sentences
        if NAME.search(s) and re.search("[a-z]{2}", NAME.sub("", s))
    ]


@pytest.mark.parametrize("other", OTHERS, ids=lambda one: one.code)
def test_whatever_a_page_may_be_told_is_in_every_language(other: Language) -> None:
    met = sentences(("app", "sessions", "estimators"), (*COMMAND_LINE, *PROGRAMMERS))
    assert [
        f"{s.where}: {s.text}" for s in met if s.text not in NOT_SO and not told(other, s)
    ] == []
