"""Lines of the log without what people typed: patients' codes, notes and names stay out, where an error quotes them, too.

An exception is logged with its type and the lines of code that it passed. Its message is left out unless it comes from the operating
system: others may quote a request, a row or a file.
"""

import logging
import time
import traceback
from types import TracebackType

LINE = "%(asctime)s %(name)s %(levelname)s %(message)s"
ExceptionInfo = (
    tuple[type[BaseException], BaseException, TracebackType | None] | tuple[None, None, None]
)


class PrivateFormatter(logging.Formatter):
    """Exceptions as places in the code; times in UTC, as the audit trail has them."""

    converter = staticmethod(time.gmtime)
    default_msec_format = "%s.%03dZ"

    def formatException(self, ei: ExceptionInfo) -> str:
        return "\n".join(_chain(ei[1])) if ei[1] else ""


def begin_logging(level: int = logging.WARNING) -> None:
    """Warnings and errors to standard error, from now on."""
    handler = logging.StreamHandler()
    handler.setFormatter(PrivateFormatter(LINE))
    logging.basicConfig(level=level, handlers=[handler], force=True)


def describe_error(problem: BaseException) -> str:
    """An error for a line of the log: its type, and the operating system's words where they are those."""
    orig = getattr(problem, "orig", None)
    name = type(problem).__name__
    if isinstance(problem, OSError) and problem.strerror:
        return f"{name}: {problem.strerror}"
    code = getattr(orig, "sqlite_errorname", None) or getattr(orig, "sqlstate", None)
    return f"{name} ({code})" if code else name


def _chain(problem: BaseException) -> list[str]:
    """The error with its causes, the first cause first."""
    cause = problem.__cause__ or (None if problem.__suppress_context__ else problem.__context__)
    before = [*_chain(cause), "which led to"] if cause is not None else []
    places = [line.rstrip() for line in traceback.format_tb(problem.__traceback__)]
    return [*before, *places, describe_error(problem)]
