"""What is refused, warned of and found is a message with a code, as far as a person with a browser can meet it."""

import json
from importlib.resources import files

from handscope.app.language import languages
from tests.app.language.sentences import sentences

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


def test_whatever_a_page_may_be_told_is_a_message() -> None:
    """Refusals, findings, warnings and reasons that a page shows are written by their code, never as a sentence."""
    met = sentences(("app", "sessions", "estimators"), (*COMMAND_LINE, *PROGRAMMERS))
    assert [f"{s.where}: {s.text}" for s in met] == []


def test_no_language_translates_by_whole_sentences() -> None:
    """Entries by an English sentence were 719; a text is translated by its code."""
    own = [files("handscope.app.language").joinpath(f"{code}.json") for code in languages()]
    parts = {part for file in own for part in json.loads(file.read_text("utf-8"))}
    assert parts == {"name", "locale", "pages", "words", "messages"}
