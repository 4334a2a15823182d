"""Independent pieces of work by two threads, with the values that they have one after the other.

In      a piece's work, the pieces; who hears how far all are
Out     values in the order of the pieces
Source  ours. numpy, BLAS and compiled loops leave the interpreter to the other thread while they
        count: two fingers take 0.6 of their time, products of matrices 0.5 of it
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Protocol, TypeVar

from handscope.estimators.errors import InputError

THREADS = 2  # cores of the smallest machine on which this is meant to run
LOOK = 0.1  # s between two words of how far it is
A = TypeVar("A")
B = TypeVar("B")


class Each(Protocol):
    """What work makes of every piece."""

    def __call__(self, work: Callable[[A], B], pieces: Iterable[A]) -> list[B]: ...


@contextmanager
def threads() -> Iterator[Each]:
    """Threads that work until the block is left."""
    with ThreadPoolExecutor(THREADS) as pool:

        def each(work: Callable[[A], B], pieces: Iterable[A]) -> list[B]:
            return list(pool.map(work, pieces))

        yield each


def run_each(
    work: Callable[[A, Callable[[float], None]], B],
    pieces: Sequence[A],
    progress: Callable[[float], None],
    threads: int = THREADS,
) -> list[B | InputError]:
    """What work made of every piece, or why it refused it. `progress` hears the share of all that
    is done, in the caller's thread.

    Work reports its share done now and then. An InputError of `progress` (no time is left) refuses
    every piece that is still being worked on; any other error ends them all and is raised.
    """
    shares, ends = [0.0] * len(pieces), list[BaseException]()

    def worked(k: int) -> B:
        def hear(share: float) -> None:
            shares[k] = share
            if ends:
                raise ends[0]

        hear(0.0)
        value = work(pieces[k], hear)
        shares[k] = 1.0
        return value

    with ThreadPoolExecutor(threads) as pool:
        going = [pool.submit(worked, k) for k in range(len(pieces))]
        try:
            while wait(going, timeout=LOOK).not_done:
                progress(sum(shares) / len(shares))
        except BaseException as end:
            ends.append(end)
    if ends and not isinstance(ends[0], InputError):
        raise ends[0]
    return [*map(_value, going)]


def _value(done: Future[B]) -> B | InputError:
    try:
        return done.result()
    except InputError as refusal:
        return refusal
