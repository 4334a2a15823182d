"""A table by a map of its columns: examined, and written as a native recording. Commands and pages both come here.

In      the table's file, a ColumnMap, events in s from the first row
Out     Findings; a native recording where one is asked for
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from handscope.estimators.data.samples import Block, Event
from handscope.estimators.messages import Message
from handscope.sessions.table_import.column_map import ColumnMap, TableLayout
from handscope.sessions.table_import.convert import blocks_of, start_of, write_native
from handscope.sessions.table_import.examine import Findings, examine
from handscope.sessions.table_import.number_columns import NumberColumns
from handscope.sessions.table_import.tables import read_table

POSES = ("initial_pose", "flat_hand")


@lru_cache(1)
def read_once(path: Path, layout: TableLayout) -> NumberColumns:
    """The table, kept until another is read: a map is examined again with each change of it."""
    return read_table(path, layout)


def check_table(path: Path, columns: ColumnMap) -> Findings:
    """What the numbers say of the map; InputError where they contradict it."""
    return examine(_blocks(path, columns), columns)


def import_table(
    path: Path,
    columns: ColumnMap,
    events: Sequence[Event],
    out: Path,
    about: Mapping[str, str],
    started: datetime | None = None,
) -> Findings:
    """A new native recording at `out`, whole or not at all; `started` is the instant of the first row, None: what the table tells."""
    blocks = _blocks(path, columns)
    found = examine(blocks, columns)
    started = started or start_of(read_once(path, columns.table), columns)
    write_native(blocks, columns, events, out, about, started)
    if any(e.trial_type in POSES for e in events):
        return found
    unposed = Message("import.seen_no_pose", {}, "warning")
    return replace(found, messages=(*found.messages, unposed))


def _blocks(path: Path, columns: ColumnMap) -> list[Block]:
    return blocks_of(read_once(path, columns.table), columns)
