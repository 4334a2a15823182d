"""A time limit for computations, checked whenever they report progress."""

import time
from collections.abc import Callable

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase

LIMIT = 1800.0  # s; the longest recording (an hour, 17 sensors) takes some minutes


def limit_time(
    seconds: float,
    on_progress: Callable[[float], None],
    now: Callable[[], float] = time.monotonic,
    from_command_line: bool = True,
) -> Callable[[float], None]:
    """A progress callback that passes shares on; it raises InputError once `seconds` have passed since this call."""
    end = now() + seconds

    def check_time(share: float) -> None:
        if now() > end:
            more = phrase("job.allow_more") if from_command_line else phrase("job.process_less")
            raise InputError("job.time_limit", seconds=seconds, more=more)
        on_progress(share)

    return check_time
