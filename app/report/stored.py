"""The computed part of a report beside its result: one file from which a report is made again without the recording.

An npz of every array and of one JSON tree that names them; values of the classes in KEPT stand there by their class and fields. Only what a report
reads of a task's details is kept: taps and ranges. A field that is newer than the file has its default; a file of other classes or with other fields is None: the caller computes anew.
"""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from handscope.app.report import content
from handscope.app.report.content import Content
from handscope.estimators.data.calibration import SensorQuality
from handscope.estimators.data.options import Description
from handscope.estimators.measures import cycles, plot_data
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.resting_drift import Drift
from handscope.estimators.measures.tapping import Tapping
from handscope.estimators.messages.sentence import Sentence, from_plain, to_plain

TREE = "tree"
STORED_TYPES: Mapping[str, type] = {
    **{
        f"{of.__module__}.{of.__name__}": of
        for of in (
            *(
                content.Visit,
                content.Content,
                content.Changed,
                content.Method,
                content.StreamFacts,
                content.RecordingFacts,
            ),
            *(
                content.CalibrationFacts,
                content.Flagged,
                content.Curve,
                content.Task,
                content.NotDone,
                content.Scored,
                content.LeftOut,
            ),
            *(
                TaskResult,
                Figure,
                Drift,
                Range,
                Tapping,
                cycles.Cycles,
                cycles.Stops,
                cycles.Params,
                plot_data.PlotData,
                plot_data.Curve,
            ),
            *(SensorQuality, Description),
        )
    }
}


def pack(whole: Content) -> bytes:
    """A content without what comes from the database: the visit, the course, the changes, what they are compared with."""
    own = replace(
        whole,
        visit=content.Visit(patient=""),
        changes=None,
        course=None,
        compared=None,
        tasks=tuple(map(_without_unread_details, whole.tasks)),
    )
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_to_json(own, arrays), separators=(",", ":"))
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, allow_pickle=False, **{TREE: np.frombuffer(tree.encode(), np.uint8)}, **arrays
    )
    return buffer.getvalue()


def unpack(data: bytes) -> Content | None:
    """What `packed` made; None where it was made of other classes or fields, or is damaged."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        found = _from_json(json.loads(arrays.pop(TREE).tobytes()), arrays)
    except (KeyError, TypeError, ValueError, EOFError, OSError, zipfile.BadZipFile):
        return None
    return found if isinstance(found, Content) else None


def _without_unread_details(task: content.Task) -> content.Task:
    """A task with only those details that a report reads."""
    details = task.result.details
    ranges = isinstance(details, list) and all(isinstance(d, Range) for d in details)
    return (
        task
        if ranges or isinstance(details, Tapping)
        else replace(task, result=replace(task.result, details=None))
    )


def _to_json(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """As JSON takes it: what it does not know is {kind: value}."""
    if isinstance(value, Sentence):
        return {"sentence": to_plain(value)}
    if isinstance(value, np.ndarray):
        arrays[name := f"a{len(arrays)}"] = value
        return {"array": name}
    if is_dataclass(value):
        data = {f.name: _to_json(getattr(value, f.name), arrays) for f in fields(value)}
        return {"of": f"{type(value).__module__}.{type(value).__name__}", "fields": data}
    if isinstance(value, Mapping):
        return {"map": [[key, _to_json(v, arrays)] for key, v in value.items()]}
    if isinstance(value, tuple):
        return {"tuple": [_to_json(v, arrays) for v in value]}
    if isinstance(value, frozenset):
        return {"set": sorted(value)}
    if isinstance(value, list):
        return [_to_json(v, arrays) for v in value]
    if isinstance(value, datetime):
        return {"moment": value.isoformat()}
    return value.item() if isinstance(value, np.generic) else value


def _from_json(data: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    if isinstance(data, list):
        return [_from_json(v, arrays) for v in data]
    if not isinstance(data, dict):
        return data
    if "of" in data:
        of = STORED_TYPES[data["of"]]
        if not data["fields"].keys() <= {f.name for f in fields(of)}:
            raise ValueError(f"{data['of']} has other fields")
        return of(**{name: _from_json(v, arrays) for name, v in data["fields"].items()})
    ((kind, inside),) = data.items()
    return KINDS[kind](inside, arrays)


KINDS: Mapping[str, Callable[[Any, Mapping[str, np.ndarray]], Any]] = {
    "array": lambda name, arrays: arrays[name],
    "map": lambda pairs, arrays: {key: _from_json(v, arrays) for key, v in pairs},
    "moment": lambda text, _: datetime.fromisoformat(text),
    "tuple": lambda each, arrays: tuple(_from_json(v, arrays) for v in each),
    "set": lambda each, _: frozenset(each),
    "sentence": lambda data, _: from_plain(data),
}
