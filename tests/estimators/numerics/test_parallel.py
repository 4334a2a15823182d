"""Two threads over independent pieces of work."""

import threading
from collections.abc import Callable

import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.numerics import parallel


def _patient(piece: threading.Event, hear: Callable[[float], None]) -> str:
    """Works until its event comes, and tells of it all the time."""
    while not piece.wait(0.001):
        hear(0.5)
    return "done"


def _set(count: int) -> list[threading.Event]:
    events = [threading.Event() for _ in range(count)]
    for event in events:
        event.set()
    return events


def test_two_pieces_are_worked_on_at_once_and_values_come_in_the_order_of_the_pieces() -> None:
    both = threading.Barrier(2, timeout=30)

    def work(piece: int) -> int:
        both.wait()
        return 10 * piece

    with parallel.threads() as each:
        assert each(work, [1, 2, 3, 4]) == [10, 20, 30, 40]


def test_a_piece_that_is_refused_costs_no_other() -> None:
    def work(piece: int, hear: Callable[[float], None]) -> int:
        if piece == 2:
            raise InputError("two is refused")
        return piece

    first, refused, last = parallel.run_each(work, [1, 2, 3], lambda share: None)
    assert (first, last) == (1, 3)
    assert isinstance(refused, InputError) and str(refused) == "two is refused"


def test_progress_is_reported_in_the_callers_thread() -> None:
    shares, events = [], [threading.Event(), *_set(1)]

    def progress(share: float) -> None:
        shares.append((share, threading.current_thread()))
        if share == 0.75:  # one is done, the other half
            events[0].set()

    assert parallel.run_each(_patient, events, progress) == ["done", "done"]
    assert shares[-1][0] >= 0.75 and {thread for _, thread in shares} == {
        threading.current_thread()
    }


def test_when_the_time_is_over_what_is_done_stays_and_the_rest_is_refused() -> None:
    def progress(share: float) -> None:
        if share >= 1 / 3:
            raise InputError("the time is over")

    done, *late = parallel.run_each(
        _patient, [*_set(1), threading.Event(), threading.Event()], progress
    )
    assert done == "done"
    assert [str(piece) for piece in late] == ["the time is over"] * 2


def test_what_else_ends_the_progress_ends_all_and_is_raised() -> None:
    def progress(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        parallel.run_each(_patient, [threading.Event(), threading.Event()], progress)


def test_an_error_of_one_piece_is_raised() -> None:
    def work(piece: int, hear: Callable[[float], None]) -> int:
        return 1 // piece

    with pytest.raises(ZeroDivisionError):
        parallel.run_each(work, [0, 1], lambda share: None)
