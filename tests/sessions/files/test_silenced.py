"""Warnings of libraries are silenced in one thread without another's being put back wrongly."""

import threading
import warnings

import pytest

from handscope.sessions.files.silenced import without_warnings


def test_a_second_thread_waits_until_the_filters_are_back() -> None:
    inside, leave = threading.Event(), threading.Event()

    def first() -> None:
        with without_warnings():
            inside.set()
            leave.wait(5.0)

    threads = [threading.Thread(target=first)]
    threads[0].start()
    inside.wait(5.0)
    filters: list[object] = []

    def second() -> None:
        with without_warnings():
            filters.extend(warnings.filters)

    threads.append(threading.Thread(target=second))
    threads[1].start()
    threads[1].join(0.05)
    assert threads[1].is_alive()  # and has set no filter of its own yet
    leave.set()
    for thread in threads:
        thread.join(5.0)
    assert filters
    with pytest.warns(UserWarning, match="said again"):
        warnings.warn("said again", UserWarning, stacklevel=1)


def test_only_the_named_category_is_silenced() -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with without_warnings(UserWarning):
            warnings.warn("gone", UserWarning, stacklevel=1)
            warnings.warn("kept", RuntimeWarning, stacklevel=1)
    assert [w.category for w in said] == [RuntimeWarning]
