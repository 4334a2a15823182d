"""No computation runs for ever: whoever hears how far it is says when it took too long."""

import time
from collections.abc import Callable

from handscope.estimators.errors import InputError

LIMIT = 1800.0  # s; the longest recording that is kept (an hour, 17 sensors) takes some minutes


def within(
    seconds: float,
    hear: Callable[[float], None],
    now: Callable[[], float] = time.monotonic,
    commanded: bool = True,
) -> Callable[[float], None]:
    """Hears shares done and passes them on; InputError as soon as more than `seconds` went by since this was made; `commanded`: by a command line."""
    end = now() + seconds

    def heard(share: float) -> None:
        if now() > end:
            more = (
                "allow more with --time-limit SECONDS, or process less at once"
                if commanded
                else "process less at once, or by another method"
            )
            raise InputError(
                f"{seconds:g} s were not enough, what was not done by then is left out; {more}"
            )
        hear(share)

    return heard
