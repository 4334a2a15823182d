"""Handscope: an instrument that measures how a hand moves.

    import handscope

    recording = handscope.load("tapping.zip")
    result = handscope.process(recording, method="m2")
    print(result.trajectory.angles.shape)  # (n, joints, 3) rad

The rooms are `handscope.estimators` (numerics), `handscope.sessions` (what is stored), `handscope.app` (what runs)
and `handscope.static` (the pages). Nothing is imported before it is used: a process that only records loads no numerics.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handscope.app.analysis import load as load
    from handscope.app.analysis import process as process

__all__ = ["load", "process"]


def __getattr__(name: str) -> Any:
    """Import the analysis when it is first asked for (PEP 562)."""
    if name in __all__:
        return getattr(import_module("handscope.app.analysis"), name)
    raise AttributeError(f"module 'handscope' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
