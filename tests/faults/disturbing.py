"""What a test does to a server that runs, by files beside its data folder: its wall clock jumps, its live method fails."""

import time
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any

from handscope.estimators.methods import DEFAULT, METHODS
from handscope.sessions.db import tables

CLOCK, FAILS = "clock", "fails"  # s by which the wall clock is off; there while the method fails


def install(folder: Path) -> None:
    """In the server's process, before it serves."""
    true, method = time.time, METHODS[DEFAULT]
    good = method.step

    def off() -> float:
        place = folder / CLOCK
        return float(place.read_text() or 0.0) if place.exists() else 0.0

    class Jumping(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
            return datetime.now(tz) + timedelta(seconds=off())

    def failing(*arguments: Any) -> Any:
        if (folder / FAILS).exists():
            raise FloatingPointError("made to fail by a test")
        return good(*arguments)

    tables.datetime = Jumping  # type: ignore[misc]  # sessions.tables.now is the only clock of what is kept
    time.time = lambda: true() + off()
    method.step = failing  # type: ignore[attr-defined]
