"""Compiled kernels as the plain Python that they are written in: nothing is translated for a test."""

from collections.abc import Callable
from functools import cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

from numba.extending import is_jitted


@cache
def interpreted(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel and all that it calls, uncompiled. What the product runs is the same code compiled:
    `test_update_cycle.py` compares both."""
    function = getattr(kernel, "py_func", kernel)
    names = function.__code__.co_names
    scope = {
        name: _uncompiled(value, names) if name in names else value
        for name, value in function.__globals__.items()
    }
    return FunctionType(function.__code__, scope, function.__name__, function.__defaults__)


def _uncompiled(value: Any, names: tuple[str, ...]) -> Any:
    """What a kernel reaches by a global name: a kernel, a module of kernels, or any other thing."""
    if is_jitted(value):
        return interpreted(value)
    if isinstance(value, ModuleType):
        taken = {name: getattr(value, name) for name in names if hasattr(value, name)}
        if any(is_jitted(member) for member in taken.values()):
            return SimpleNamespace(**{n: _uncompiled(m, ()) for n, m in taken.items()})
    return value
