"""What a library warns of while it reads or writes a file, where that is not a person's to know."""

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_ONE_AT_A_TIME = threading.RLock()  # the filters of warnings are the whole process's


@contextmanager
def without_warnings(category: type[Warning] = Warning) -> Iterator[None]:
    """No warning of this category meanwhile: one thread at a time, or one would put back the filters that another set."""
    with _ONE_AT_A_TIME, warnings.catch_warnings():
        warnings.simplefilter("ignore", category)
        yield
