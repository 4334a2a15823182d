"""Modules that are not everywhere: packages that another one imports where they are installed, and those of one operating system."""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def hidden(*names: str) -> Iterator[None]:
    """Importing one of these packages fails meanwhile, as if it were not installed; one that is
    imported already stays."""
    modules: dict[str, Any] = sys.modules
    absent = [name for name in names if name not in modules]
    modules.update(dict.fromkeys(absent))  # None: ModuleNotFoundError
    try:
        yield
    finally:
        for name in absent:
            modules.pop(name, None)


def system_module(name: str) -> Any:
    """A module of this operating system; None where it is not of this one."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
