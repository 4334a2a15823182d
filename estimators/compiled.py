"""Row-wise arithmetic compiled to machine code: what is written for one row runs over arrays of any leading shape, broadcast as by numpy.

numba translates a kernel when its module is first imported on a machine, some tenths of a second each, and keeps the code beside the module (or in the
user's cache where that folder is not writable). docs/decisions/0004-compiled-rows.md has why and what it gains.
"""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import boolean, float64, guvectorize
from numpy.typing import NDArray

Compiled = Callable[..., NDArray[np.float64]]
Told = Callable[..., NDArray[np.bool_]]


def rowwise(layout: str) -> Callable[[Callable[..., None]], Compiled]:
    """A kernel of float64 rows as a numpy ufunc; `layout` as of generalised ufuncs, "(q),(v)->(v)": the kernel fills its last argument.

    Sums are never reordered (no fastmath), so a row's result does not depend on its neighbours. NaN is what is not known: it passes through, unwarned.
    """
    return lambda kernel: _over_rows(kernel, layout, float64)


def told_by_row(layout: str) -> Callable[[Callable[..., None]], Told]:
    """As `rowwise`, of a kernel that says yes or no."""
    return lambda kernel: _over_rows(kernel, layout, boolean)


def _over_rows(kernel: Callable[..., None], layout: str, gives: Any) -> Callable[..., Any]:
    taken, given = layout.split("->")
    types = [_typed(core, float64, float64) for core in _cores(taken)] + [_typed(core, gives, gives[:]) for core in _cores(given)]
    ufunc = guvectorize([tuple(types)], layout, nopython=True, cache=True)(kernel).ufunc

    def over_rows(*arrays: Any) -> Any:
        with np.errstate(invalid="ignore"):
            return ufunc(*arrays)

    return over_rows


def _cores(layout: str) -> list[str]:
    return re.findall(r"\(([^)]*)\)", layout)


def _typed(core: str, each: Any, scalar: Any) -> Any:
    dimensions = len([d for d in core.split(",") if d.strip()])
    return each[(slice(None),) * dimensions] if dimensions else scalar
