"""Self-calibration in a process of its own, or on the administrator's cluster: it takes a minute of a core, and must not slow the live view.

The process ends by itself when its parent is gone; one that takes longer than LONGEST is ended.
"""

import logging
import threading
import time
from typing import Any

from handscope.app.workers.cluster import worker
from handscope.app.workers.process import DiedError, Send, no_context
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import join, phrase
from handscope.sessions.clinic.self_calibrations import FoundCalibration
from handscope.sessions.files.recording import LoadedRecording

log = logging.getLogger(__name__)
LONGEST = 600.0  # s
ENDED = phrase("self_calibration.ended")
TOO_LONG = phrase("self_calibration.took_too_long")


class SelfCalibrationSolver:
    """One computation; it runs from construction until it has a solution or a refusal, or is closed."""

    def __init__(self, recording: LoadedRecording, scheduler: str | None = None) -> None:
        self.share = 0.0  # of the work that is done, 0 to 1
        self.solution: FoundCalibration | None = None
        self.refusal = ""
        self._started = time.monotonic()
        self._process = worker(scheduler, no_context)
        self._process.start()
        self._thread = threading.Thread(
            target=self._run, args=(recording,), name="self-calibration", daemon=True
        )
        self._thread.start()

    def _run(self, recording: LoadedRecording) -> None:
        try:
            for name, value in self._process.stream(_solve, recording):
                setattr(self, name, value)
        except InputError as unreachable:
            self.refusal = self.refusal or str(unreachable)
        except Exception as problem:  # of the process, or its end
            if not isinstance(problem, DiedError):
                log.exception("self-calibration")
            self.refusal = self.refusal or ENDED

    @property
    def is_over(self) -> bool:
        return self.solution is not None or bool(self.refusal)

    def poll(self) -> None:
        """End what is over or takes too long; never waits for a result."""
        if not self.is_over and time.monotonic() - self._started > LONGEST:
            self.refusal = TOO_LONG
        if self.is_over:
            self.close()

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._thread.join()
        self._process.__exit__()


def _solve(_: None, send: Send, recording: LoadedRecording) -> None:
    """In the process: send the name of an attribute and its value."""
    send(_outcome(recording, lambda share: send(("share", share))))


def _outcome(recording: LoadedRecording, progress: Any) -> tuple[str, Any]:
    from handscope.app.report.sections.self_calibration import found_calibration
    from handscope.estimators.methods import BATCH
    from handscope.estimators.pipeline.process import process

    method = BATCH["map"]
    try:
        processed = process(method, method.Params(), recording, progress=progress)
    except InputError as refused:
        return "refusal", str(refused)
    except OSError:
        raise
    except Exception:
        log.exception("self-calibration")
        return "refusal", ENDED
    found = found_calibration(processed.calibrations[0], processed.method_messages)
    return (
        ("refusal", join(processed.method_messages) or ENDED)
        if found is None
        else ("solution", found)
    )
