"""Turns: in order, never for ever, and with rests that leave room for others."""

import threading
import time

import pytest

from handscope.app.workers import turns as turns_module
from handscope.app.workers.turns import FULL, LONGEST_REST, Turns
from tests.app.devices.virtual import wait_for


def test_one_computes_at_a_time_and_who_finishes_a_batch_comes_before_who_begins_one() -> None:
    turns, order = Turns(), []

    def compute(name: str, first: bool) -> None:
        with turns.share().turn(first):
            order.append(name)

    assert turns.take(first=False)
    threads = []
    for k, (name, first) in enumerate(
        [("begins", False), ("begins later", False), ("finishes", True)], 1
    ):
        threads.append(threading.Thread(target=compute, args=(name, first)))
        threads[-1].start()
        wait_for(lambda k=k: len(turns._first) + len(turns._later) == k)
    turns.pass_on()
    for thread in threads:
        thread.join()
    assert order == ["finishes", "begins", "begins later"]
    assert turns.take(first=False)  # the last has passed it on


def test_who_has_waited_long_computes_beside_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns_module, "LONGEST_WAIT", 0.01)
    turns = Turns()
    assert turns.take(first=False)
    with turns.share().turn():
        pass  # the other has not passed it on
    turns.pass_on()
    assert turns.take(first=False)


def test_an_error_passes_the_turn_on() -> None:
    turns = Turns()
    with pytest.raises(ZeroDivisionError), turns.share().turn():
        raise ZeroDivisionError
    assert turns.take(first=False)


def test_stations_rest_until_all_of_them_take_their_part_of_the_time_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    turns = Turns()

    def batch(share: turns_module.Share, seconds: float) -> float:
        with share.turn():
            now[0] += seconds
        return share.rest()

    alone = turns.share()
    assert batch(alone, 0.004) == pytest.approx(0.004 / FULL - 0.004)
    others = [turns.share() for _ in range(3)]
    rests = [batch(share, 0.004) for share in (*others, alone)]
    assert rests[-1] == pytest.approx(4 * 0.004 / FULL - 0.004)  # as long as the others compute
    for share in others:
        share.leave()
    assert batch(alone, 0.004) == pytest.approx(0.004 / FULL - 0.004)
    assert batch(alone, 10.0) <= LONGEST_REST
