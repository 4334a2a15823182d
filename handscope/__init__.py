"""Handscope: an instrument that measures how a hand moves.

    import handscope as hs

    rec = hs.load("tapping.zip")
    moved = hs.process(rec, method="ekf")
    print(moved.angles(unit="deg"), moved.measures("tapping"), moved.cite())

The rooms are `handscope.estimators` (numerics), `handscope.sessions` (what is stored), `handscope.app` (what runs)
and `handscope.static` (the pages). Nothing is imported before it is used: a process that only records loads no numerics.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handscope import samples as samples
    from handscope.app.analysis.functions import InputError as InputError
    from handscope.app.analysis.functions import from_arrays as from_arrays
    from handscope.app.analysis.functions import load as load
    from handscope.app.analysis.functions import measure as measure
    from handscope.app.analysis.functions import process as process
    from handscope.app.analysis.functions import truth as truth
    from handscope.app.live.outputs.client import stream as stream

__all__ = [
    "InputError",
    "from_arrays",
    "load",
    "measure",
    "process",
    "samples",
    "stream",
    "truth",
]

MODULES = {
    "stream": "app.live.outputs.client"
}  # of names that are not in app/analysis/functions.py


def __getattr__(name: str) -> Any:
    """Import the analysis when it is first asked for (PEP 562)."""
    if name == "samples":
        return import_module("handscope.samples")
    if name in __all__:
        module = MODULES.get(name, "app.analysis.functions")
        return getattr(import_module(f"handscope.{module}"), name)
    raise AttributeError(f"module 'handscope' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
