"""Trials spread over the machine's cores, each core with one thread."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any

from threadpoolctl import threadpool_limits

from handscope.app.workers.process import CONTEXT, restore_terminal_signals
from handscope.validation.reproduce import reproduction


def measured(
    name: str, trials: Sequence[Any], jobs: int, hear: Callable[[float], None]
) -> list[tuple[Any, Any]]:
    """Every trial of a reproduction with its result, in their order; `hear` is called with the share done."""
    found: list[Any] = [None] * len(trials)
    done = _here(name, trials) if jobs == 1 or len(trials) == 1 else _spread(name, trials, jobs)
    for count, (k, value) in enumerate(done, 1):
        found[k] = value
        hear(count / len(trials))
    return list(zip(trials, found))


def _here(name: str, trials: Sequence[Any]) -> Iterator[tuple[int, Any]]:
    """In this process."""
    with threadpool_limits(1):
        for k, trial in enumerate(trials):
            yield k, reproduction(name).measure(trial)


def _spread(name: str, trials: Sequence[Any], jobs: int) -> Iterator[tuple[int, Any]]:
    """In `jobs` processes of their own, as they become ready; a trial that fails ends all."""
    with ProcessPoolExecutor(min(jobs, len(trials)), CONTEXT, _begin) as pool:
        futures = {pool.submit(_measure, name, trial): k for k, trial in enumerate(trials)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _begin() -> None:
    restore_terminal_signals()
    threadpool_limits(1)


def _measure(name: str, trial: Any) -> Any:
    return reproduction(name).measure(trial)
