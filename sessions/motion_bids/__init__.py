"""Motion-BIDS in and out: the contract with other programs (docs/motion-bids.md). The reader is imported when it is first used: who opens a native recording needs none."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handscope.sessions.motion_bids.reader import load as load
    from handscope.sessions.motion_bids.writer import write as write

MODULES = {"load": "reader", "write": "writer"}


def __getattr__(name: str) -> Any:
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
