"""Row-wise arithmetic compiled to machine code: what is written for one row runs over arrays of any
leading shape, broadcast as by numpy.

numba translates a kernel when it is first called on a machine, some tenths of a second each, and
keeps the code beside the module (or in the user's cache where that folder is not writable). Later
processes load it, some milliseconds each, at a kernel's first call: who cannot wait there calls
`load_kernels`. docs/decisions/0004-compiled-rows.md has why and what it gains.
"""

import builtins
import hashlib
import re
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.optional_imports import hidden, import_without_package
from handscope.estimators.numerics.typing import Bools

with hidden("cffi", "yaml"):  # 0.09 s of every start; no kernel calls C, nothing is set in a file
    from numba import boolean, float64, njit
    from numba.extending import is_jitted
    from numba.np.ufunc.ufuncbuilder import GUFuncBuilder

    import_module("numba.core.typing.cffi_utils")

    from handscope.estimators.numerics.translation.kept_code import load_without_translator
    from handscope.estimators.numerics.translation.linked_functions import LinkedFunction
    from handscope.estimators.numerics.translation.translation_lock import translating

load_without_translator()
# numba looks there for what its kernels call of LAPACK; importing all of scipy.linalg takes 0.04 s
import_without_package("scipy.linalg", "cython_blas", "cython_lapack")

# what makes each row kernel of the modules that were imported
_BUILDERS: list[Callable[[], Any]] = []


class Compiled(Protocol):
    """A kernel over arrays; `row` is what other kernels call for one row of it, with the last
    argument to be filled."""

    row: Callable[..., None]

    def __call__(self, *arrays: Any) -> NDArray[np.float64]: ...


class RowPredicate(Protocol):
    """The same that says yes or no."""

    row: Callable[..., None]

    def __call__(self, *arrays: Any) -> Bools: ...


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of one row that kernels call; it may fill its arguments."""
    return LinkedFunction(function)


def rowwise(layout: str) -> Callable[[Callable[..., None]], Compiled]:
    """A kernel of float64 rows as a numpy ufunc; `layout` as of generalised ufuncs, "(q),(v)->(v)":
    the kernel fills its last argument, or its last ones where the layout names more than one
    result.

    Sums are never reordered (no fastmath), so a row's result does not depend on its neighbours. NaN
    is what is not known: it passes through, unwarned.
    """
    return lambda kernel: _over_rows(kernel, layout, float64)


def rowwise_bool(layout: str) -> Callable[[Callable[..., None]], RowPredicate]:
    """As `rowwise`, of a kernel that says yes or no."""
    return lambda kernel: _over_rows(kernel, layout, boolean)


def looped(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """A loop over samples or chains, whose arguments may be records of arrays, and be filled:
    translated when it is first called on a machine, and kept. No fastmath. Other threads work
    meanwhile."""
    _name_by_calls(kernel)
    compiled: Callable[..., Any] = njit(error_model="numpy", cache=True, nogil=True)(kernel)
    return compiled


def load_kernels() -> None:
    """Load, or translate, every row kernel of the modules that were imported."""
    for build in _BUILDERS:
        build()


def _over_rows(kernel: Callable[..., None], layout: str, gives: Any) -> Any:
    row = inlined(kernel)
    _name_by_calls(kernel)
    build = cache(lambda: _ufunc(kernel, layout, gives))
    _BUILDERS.append(build)

    def over_rows(*arrays: Any) -> Any:
        ufunc = build()
        with np.errstate(invalid="ignore"):
            return ufunc(*arrays)

    over_rows.row = row  # type: ignore[attr-defined]
    return over_rows


def _ufunc(kernel: Callable[..., None], layout: str, gives: Any) -> Any:
    taken, given = layout.split("->")
    types = [_typed(core, float64, float64) for core in _cores(taken)] + [
        _typed(core, gives, gives[:]) for core in _cores(given)
    ]
    # guvectorize, but for what lets other kernels call the ufunc itself: 17 ms of every start
    builder = GUFuncBuilder(kernel, layout, cache=True, targetoptions={"nopython": True})
    with translating():
        builder.add(tuple(types))
        return builder.build_ufunc()


def _name_by_calls(kernel: Callable[..., Any]) -> None:
    """numba identifies a cached kernel by its own file: what it calls may stand in others and gives it a
    name of its own."""
    if called := list(called_by(kernel)):
        kernel.__qualname__ += "_" + hashlib.sha256(repr(called).encode()).hexdigest()[:12]


def called_by(kernel: Callable[..., Any]) -> Iterator[Any]:
    """Code of the functions that a kernel calls, and numbers that it takes from its module or
    others."""
    names, scope = kernel.__code__.co_names, kernel.__globals__
    for within in (scope, *(vars(scope[n]) for n in names if isinstance(scope.get(n), ModuleType))):
        for name in names:
            value = within.get(name)
            if is_jitted(value):
                yield name, value.py_func.__code__.co_code, value.py_func.__code__.co_consts
                yield from _record_fields(value.py_func)
                yield from called_by(value.py_func)
            elif isinstance(value, int | float | tuple):
                yield name, value


def _record_fields(function: Callable[..., Any]) -> Iterator[Any]:
    """Names of the fields of records that a function takes, which its code has by their places only."""
    scope = function.__globals__
    known = (builtins, np.ndarray, *(v for v in scope.values() if isinstance(v, ModuleType)))
    names = (n for n in function.__code__.co_names if n not in scope)
    if fields := [n for n in names if not any(hasattr(k, n) for k in known)]:
        yield fields


def _cores(layout: str) -> list[str]:
    return re.findall(r"\(([^)]*)\)", layout)


def _typed(core: str, each: Any, scalar: Any) -> Any:
    dimensions = len([d for d in core.split(",") if d.strip()])
    return each[(slice(None),) * dimensions] if dimensions else scalar
