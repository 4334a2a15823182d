"""Modules that are not everywhere: packages that another one imports where they are installed, and those of one operating system."""

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
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


@contextmanager
def not_by_star(package: ModuleType, *names: str) -> Iterator[None]:
    """Meanwhile `from package import *`, `dir` with `hasattr`, and an attribute do not import these submodules, which
    the package imports when it is first asked for them; importing one by its name does."""
    module: Any = package
    listed, ask = module.__all__, module.__getattr__
    absent = [name for name in names if name not in vars(package)]

    def ask_for_others(name: str) -> Any:
        if name in absent:
            raise AttributeError(name)
        return ask(name)

    module.__all__ = [name for name in listed if name not in absent]
    module.__getattr__ = ask_for_others
    try:
        yield
    finally:
        module.__all__, module.__getattr__ = listed, ask


def import_without_package(package: str, *names: str) -> None:
    """Import modules of a package, but nothing of what the package itself imports; one that is imported already stays."""
    spec = importlib.util.find_spec(package)
    if package in sys.modules or spec is None:
        return
    sys.modules[package] = importlib.util.module_from_spec(spec)  # with its path, not carried out
    try:
        for name in names:
            importlib.import_module(f"{package}.{name}")
    finally:
        del sys.modules[package]


def system_module(name: str) -> Any:
    """A module of this operating system; None where it is not of this one."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
