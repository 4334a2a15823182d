"""Which tracker sits where: a person goes before the firmware, and the tracker that is shaken is known."""

import time
from collections.abc import Sequence

import numpy as np

from handscope.app.devices.sources.source import About, Arrived, Level, Measured, Occurred
from handscope.app.devices.sources.tracker_table import TrackerTable
from handscope.app.devices.sources.translated import TranslatedPort
from handscope.estimators.data.samples import ORIENTATION
from handscope.sessions.wire.assembly import Assembler

A, B = "AA/0", "BB/0"
HZ = 100


def turning(sensor: str, own: str, rate: float, first: int = 0, n: int = 200) -> Measured:
    """Samples of a sensor that turns about z at `rate` rad/s."""
    k = np.arange(first, first + n)
    half = 0.5 * rate * k / HZ
    q = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1)
    t = BEGAN + np.rint(k * 1e9 / HZ).astype(np.int64)
    return Measured((own,) if own else (), (ORIENTATION,), t, q[:, None], float(HZ), sensor)


BEGAN = time.monotonic_ns()


class Trackers:
    """A source that gives what a test says."""

    about = About("trackers", 7, mounting={"index_middle": (0.0, 1.0, 0.0, 0.0)})

    def __init__(self) -> None:
        self.waiting: list[Sequence[Arrived]] = []

    def receive(self, wait: float) -> Sequence[Arrived]:
        return self.waiting.pop(0) if self.waiting else []

    def take_originals(self) -> tuple[()]:
        return ()

    def counts(self) -> dict[str, int | float]:
        return {}

    def close(self) -> None:
        pass


def read(port: TranslatedPort, source: Trackers, assembler: Assembler, *some: Arrived) -> None:
    source.waiting.append(some)
    assembler.feed(port.read(65536), time.monotonic())


def worn(assembler: Assembler) -> dict[str, int]:
    """Samples by segment."""
    return {
        s.sensors[0]: assembler.counts[s.name].samples
        for s in assembler.streams.values()
        if s.name in assembler.counts
    }


def test_a_tracker_without_a_place_is_listed_and_recorded_once_it_has_one() -> None:
    source, assembler = Trackers(), Assembler()
    port = TranslatedPort(source)
    read(port, source, assembler, turning(A, "", 0.1))
    assert [(r["sensor"], r["place"]) for r in port.trackers()] == [(A, "")]
    assert worn(assembler) == {}
    port.place({A: "index_middle"})
    read(port, source, assembler, turning(A, "", 0.1, 200))
    assert worn(assembler) == {"index_middle": 200}


def test_a_person_goes_before_the_device_and_no_segment_has_two_trackers() -> None:
    source, assembler = Trackers(), Assembler()
    port = TranslatedPort(source)
    read(port, source, assembler, turning(A, "index_middle", 0.1), turning(B, "hand", 0.1))
    port.place({B: "index_middle"})
    read(
        port, source, assembler, turning(A, "index_middle", 0.1, 200), turning(B, "hand", 0.1, 200)
    )
    assert {r["sensor"]: r["place"] for r in port.trackers()} == {A: "", B: "index_middle"}
    assert set(worn(assembler)) == {"index_middle"}


def test_exchanged_trackers_go_on_at_each_others_segment_without_a_loss() -> None:
    source, assembler = Trackers(), Assembler()
    port = TranslatedPort(source)
    read(port, source, assembler, turning(A, "index_middle", 0.0), turning(B, "hand", 2.0))
    port.place({A: "hand", B: "index_middle"})
    read(
        port, source, assembler, turning(A, "index_middle", 0.0, 200), turning(B, "hand", 2.0, 200)
    )
    assert set(worn(assembler)) == {"index_middle", "hand"}
    assert all(count.lost == 0 for count in assembler.counts.values())
    np.testing.assert_allclose(assembler.mounting["hand"], [0.0, 1.0, 0.0, 0.0])  # it was A's


def test_the_tracker_that_is_shaken_or_tapped_is_known_with_its_battery_and_signal() -> None:
    table, now = TrackerTable(), BEGAN * 1e-9 + 2.0
    assert table.placed(turning(A, "hand", 0.1)) is not None
    assert table.placed(turning(B, "", 5.0)) is None
    table.note_level(Level("AA", battery=40))
    table.note_level(Level("BB", signal=-80))
    table.note_tap(A, now)
    a, b = table.rows(now)
    assert [a["moving"], b["moving"]] == [False, True]
    assert [a["tapped"], b["tapped"]] == [True, False]
    assert [a["battery"], a["signal"], b["battery"], b["signal"]] == [40, None, None, -80]
    assert not any(row["tapped"] or row["moving"] for row in table.rows(now + 10.0))


def test_a_tap_of_the_device_reaches_the_table() -> None:
    source, assembler = Trackers(), Assembler()
    port, now = TranslatedPort(source), time.monotonic_ns()
    read(port, source, assembler, turning(A, "", 0.1), turning(B, "", 0.1))
    read(port, source, assembler, Occurred(now, "annotation", {"note": "tap", "tracker": A}))
    assert {row["sensor"]: row["tapped"] for row in port.trackers()} == {A: True, B: False}
