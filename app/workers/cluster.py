"""Long work on the administrator's Dask cluster in place of a process of this machine: reports, exports, self-calibrations.

Each call is one task. The cluster's workers have the same version of this program, and see the data folder and the database under the same names where the
work needs them (as with cohorts, app/exporting/cohort.py). What a worker that dies was doing is begun again on another one, by Dask; after its fourth such
death (Dask's setting `allowed-failures`) the work ends as one whose process has died. A task that nobody waits for any more is dropped where it still waits, and ends at its next message
where it sends some; one that sends none is finished in vain.
"""

import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar

from handscope.app.workers.process import DiedError, Send, WorkerProcess
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase

C = TypeVar("C")
On = TypeVar("On", covariant=True)
P = ParamSpec("P")
T = TypeVar("T")
LOOK = 0.1  # s between two looks whether the work is done, or not wanted any more
PATIENCE = 10.0  # s for the scheduler to answer


class Worker(Protocol[On]):
    """What runs one call after the other elsewhere: WorkerProcess describes each."""

    def do(self, work: Callable[Concatenate[On, P], T], *given: P.args, **named: P.kwargs) -> T: ...
    def stream(
        self, work: Callable[Concatenate[On, Send, P], None], *given: P.args, **named: P.kwargs
    ) -> Iterator[Any]: ...
    def start(self) -> None: ...
    def kill(self) -> None: ...
    def __exit__(self, *_: object) -> None: ...


def worker(scheduler: str | None, prepare: Callable[..., C], *arguments: Any) -> Worker[C]:
    """A process of this machine, or the cluster of the scheduler at that address."""
    if scheduler is None:
        return WorkerProcess(prepare, *arguments)
    return ClusterWorker(scheduler, prepare, *arguments)


class ClusterWorker(Generic[C]):
    """As WorkerProcess, on a cluster. InputError where the scheduler cannot be reached."""

    def __init__(self, scheduler: str, prepare: Callable[..., C], *arguments: Any) -> None:
        self._scheduler = scheduler
        self._prepare, self._arguments = prepare, arguments
        self._unwanted = threading.Event()

    def __exit__(self, *_: object) -> None:
        self.kill()

    def start(self) -> None:
        """Nothing: the cluster is there."""

    def kill(self) -> None:
        """The call that runs, if any, is not wanted any more."""
        self._unwanted.set()

    def do(self, work: Callable[Concatenate[C, P], T], *given: P.args, **named: P.kwargs) -> T:
        """Call `work(context, ...)` on the cluster; its value or its error, DiedError where its workers died."""
        with self._submit(_call, work, given, named) as (_, future):
            while not future.done():
                self._wait()
            done: T = _result(future)
            return done

    def stream(
        self, work: Callable[Concatenate[C, Send, P], None], *given: P.args, **named: P.kwargs
    ) -> Iterator[Any]:
        """What `work(context, send, ...)` sends, as it comes; then its error, DiedError where its workers died."""
        from distributed import Queue

        name = uuid.uuid4().hex
        with self._submit(_call_with_send, work, given, named, name) as (client, future):
            sent = Queue(name, client=client)
            is_done = False
            while not is_done:
                is_done = future.done()  # before looking for what was sent until then
                while sent.qsize():
                    yield sent.get()
                if not is_done:
                    self._wait()
            sent.close()
            _result(future)

    def _wait(self) -> None:
        if self._unwanted.wait(LOOK):
            raise DiedError(None)

    @contextmanager
    def _submit(self, call: Callable[..., Any], *request: Any) -> Iterator[tuple[Any, Any]]:
        """The client and the task; it is dropped with the client."""
        from distributed import Client

        self._unwanted.clear()
        try:
            client = Client(self._scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError) as problem:
            raise InputError(
                "result.scheduler_unreachable", value=self._scheduler, problem=str(problem)
            ) from None
        with client:
            future = client.submit(
                call, self._prepare, self._arguments, *request, pure=False, key=_key(request[0])
            )
            try:
                yield client, future
            finally:
                future.cancel()


def _key(work: Callable[..., Any]) -> str:
    """A name under which the administrator sees the task."""
    return f"handscope-{work.__name__.strip('_')}-{uuid.uuid4().hex}"


def _result(future: Any) -> Any:
    """The value or the error of a task that is done."""
    from concurrent.futures import CancelledError

    from distributed.scheduler import KilledWorker

    try:
        return future.result(timeout=PATIENCE)
    except (KilledWorker, CancelledError, TimeoutError, OSError) as problem:
        raise DiedError(None) from problem


@lru_cache(maxsize=8)
def _context(prepare: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """On a worker: what calls work on, once for each worker."""
    return prepare(*arguments)


def _call(prepare: Any, arguments: Any, work: Callable[..., T], given: Any, named: Any) -> T:
    return work(_context(prepare, arguments), *given, **named)


def _call_with_send(
    prepare: Any, arguments: Any, work: Callable[..., T], given: Any, named: Any, name: str
) -> T:
    from distributed import Queue, get_worker

    here = get_worker()
    key, sent = here.get_current_task(), Queue(name)

    def send(message: Any) -> None:
        task = here.state.tasks.get(key)
        if task is None or task.state != "executing":
            raise InputError(phrase("result.stopped"))
        sent.put(message)

    return work(_context(prepare, arguments), send, *given, **named)
