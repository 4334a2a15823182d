"""How long a report takes once its session is processed: the PDF and the HTML file of a whole assessment with the course of twenty sessions."""

import statistics
import time
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from handscope.app.language import languages
from handscope.app.protocols import load_all
from handscope.app.report import FORMS, Style
from handscope.app.report.content import Content, Visit, content
from handscope.app.results.make import figure_rows
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.clinic.references import Course
from handscope.sessions.clinic.references import Visit as Past
from handscope.sessions.clinic.repeatability import Values, values
from handscope.sessions.files.recording import LoadedRecording
from handscope.validation.benchmarks import Metric

TASKS = (
    "initial_pose",
    "rom_fist",
    "rom_spread",
    "rom_thumb",
    "rom_wrist",
    "tapping",
    "tapping",
    "tapping",
)
SESSIONS, REPEATS = 20, 3
TARGET = 3.0  # s


def measure() -> list[Metric]:
    """Seconds for the PDF and the HTML file, by language."""
    made = _content()
    return [
        Metric(f"{form} in {language.name}", _seconds(made, form, language), "s", TARGET, "lower")
        for form, language in _report_forms()
    ]


def _report_forms() -> list[tuple[str, Any]]:
    return [(form, language) for form in ("pdf", "html") for language in languages().values()]


def _seconds(made: Content, form: str, language: Any) -> float:
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        FORMS[form](made, Style(language))
        seconds.append(time.perf_counter() - began)
    return statistics.median(seconds)


def _content() -> Content:
    moved = simulate(
        TASKS, "left", sized("left"), np.random.default_rng(1), SensorErrors(), SEGMENTS
    )
    recording = LoadedRecording("left", moved.geometry, moved.mounting, moved.samples, moved.events)
    params = m2.Params()
    processed = process(m2, params, recording)
    results = assess(processed.trajectory, recording.events)
    now = values([f for t in results for f in figure_rows(t)])
    end = datetime(2026, 11, 21, tzinfo=UTC)
    past = tuple(
        Past(end - timedelta(days=7 * k), _moved_trajectory(now, k))
        for k in reversed(range(SESSIONS))
    )
    return content(
        Visit(patient="bench", date=end),
        recording,
        processed,
        "m2",
        params,
        results,
        "bench",
        load_all(),
        course=Course(past, past[0]),
    )


def _moved_trajectory(now: Values, k: int) -> Values:
    return {key: (value * (1 - 0.01 * k), unit) for key, (value, unit) in now.items()}
