"""Where trackers sat the last time, by hand and tracker, in the data folder: offered again with the next session.

A file, `tracker_places.json`: {"left": {"A4:CF:12:00:00:07/0": "index_proximal"}}; an empty segment is a tracker that was not worn.
"""

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT, Hand
from handscope.sessions.tables_io.writing import save_file

FILE = "tracker_places.json"
PLACES = "tracker_places"  # in a recording's metadata
MOST, LONGEST = 64, 80  # trackers at a time, characters of a name
MOST_STORED = 1000  # trackers of a hand; then the oldest are forgotten


def require_places(places: Mapping[str, str]) -> None:
    """InputError where a segment is none, or where two trackers are on one."""
    if len(places) > MOST or any(len(sensor) > LONGEST for sensor in places):
        raise InputError("table.too_many_trackers", most=MOST, longest=LONGEST)
    taken: dict[str, str] = {}
    for sensor, segment in places.items():
        if segment and segment not in SEGMENT:
            raise InputError("table.tracker_segment_unknown", segment=segment, sensor=sensor)
        if segment in taken:
            raise InputError(
                "table.trackers_on_one_segment",
                segment=segment,
                sensor=sensor,
                other=taken[segment],
            )
        if segment:
            taken[segment] = sensor


def with_changed(
    by_person: Mapping[str, str], rows: Sequence[Mapping[str, Any]], changed: Mapping[str, str]
) -> dict[str, str]:
    """Where trackers sit by a person's word after a change; one that `rows` show on one of the new segments is not worn any more."""
    shown = {row["sensor"]: row["place"] for row in rows}
    taken = set(changed.values()) - {""}
    displaced = {s: "" for s, p in {**shown, **by_person}.items() if p in taken}
    return {**by_person, **displaced, **changed}


def read_places(data: Path, hand: Hand) -> dict[str, str]:
    """Where trackers of a hand sat; empty where nothing is kept or the file cannot be read: it is only an offer."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError, InputError):
        stored = json.loads((data / FILE).read_text("utf-8"))[hand]
        places = {str(sensor): str(segment) for sensor, segment in stored.items()}
        for sensor, segment in places.items():
            require_places({sensor: segment})
        return places
    return {}


def store_places(data: Path, hand: Hand, places: Mapping[str, str]) -> None:
    """Keep where trackers of a hand sit; who sat on one of these segments before is forgotten."""
    require_places(places)
    others: dict[str, dict[str, str]] = {h: read_places(data, h) for h in ("left", "right")}
    worn = set(places.values()) - {""}
    before = {s: p for s, p in others[hand].items() if s not in places and p not in worn}
    others[hand] = dict(list({**before, **places}.items())[-MOST_STORED:])
    save_file(json.dumps(others, indent=1).encode(), data / FILE)
