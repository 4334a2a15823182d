"""A computation that takes too long ends with a sentence."""

import pytest

from handscope.app.workers.deadline import limit_time
from handscope.estimators.errors import InputError


def test_what_takes_too_long_ends_and_says_what_to_do() -> None:
    clock, heard = [0.0], []
    on_progress = limit_time(30.0, heard.append, lambda: clock[0])
    on_progress(0.5)
    clock[0] = 30.0
    on_progress(0.6)
    clock[0] = 30.1
    with pytest.raises(InputError, match=r"^30 s were not enough.*--time-limit"):
        on_progress(0.7)
    assert heard == [0.5, 0.6]
