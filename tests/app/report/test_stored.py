"""What is kept of a report is all that the report needs: made from it, every form is the same to the byte."""

import io
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handscope.app.language import languages
from handscope.app.report import FORMS, Style
from handscope.app.report.stored import STORED_TYPES, pack, unpack
from handscope.estimators.data.samples import Event
from tests.app.report.simulated_sessions import VISIT, gap_in_the_little_finger, report, session

EVERYTHING = ("initial_pose", "rom_fist", "tapping", "open_close", "tremor_rest")
TOLD = (
    Event(1.0, 0.0, "annotation", {"task_name": "reach", "outcome": "unable: pain"}),
    Event(1.0, 0.0, "annotation", {"task_name": "rom_wrist", "outcome": "skipped: no time"}),
)


def test_every_form_of_a_report_is_the_same_made_from_what_is_kept() -> None:
    made = session(EVERYTHING, change=gap_in_the_little_finger)
    whole = report(made, events=(*made[0].events, *TOLD))
    kept = unpack(pack(whole))
    assert kept is not None and kept.visit.patient == ""
    again = replace(kept, visit=VISIT)
    for form in ("html", "json", "csv"):
        style = Style(languages()["de"])
        assert FORMS[form](again, style) == FORMS[form](whole, style), form


def altered(change: Callable[[str], str]) -> bytes:
    with np.load(io.BytesIO(pack(report()))) as kept:
        arrays = {name: kept[name] for name in kept.files}
    tree = change(arrays.pop("tree").tobytes().decode())
    buffer = io.BytesIO()
    np.savez(buffer, tree=np.frombuffer(tree.encode(), np.uint8), **arrays)
    return buffer.getvalue()


OTHERS: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "foreign": lambda: b"nothing of ours",
    "cut": lambda: pack(report())[:-200],
    "half a tree": lambda: altered(lambda tree: tree[: len(tree) // 2]),
    "another field": lambda: altered(lambda tree: tree.replace('"meaning"', '"sense"')),
    "another class": lambda: altered(
        lambda tree: tree.replace("range_of_motion.Range", "range_of_motion.Params")
    ),
    "a class not ours": lambda: altered(
        lambda tree: json.dumps({"of": "builtins.eval", "fields": {}})
    ),
    "no content": lambda: altered(lambda tree: "[]"),
}


@pytest.mark.parametrize("which", OTHERS)
def test_a_file_of_another_form_is_none(which: str) -> None:
    assert unpack(OTHERS[which]()) is None


def test_every_class_that_is_kept_is_named_once() -> None:
    assert len(set(STORED_TYPES.values())) == len(STORED_TYPES)
