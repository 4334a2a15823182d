"""Values that are costly to make and the same for the same arguments: made once for all processes and later runs."""

import hashlib
import os
import pickle
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / ".pytest_cache" / "recordings"
SOURCES = (
    "estimators/simulation",
    "estimators/numerics",
    "estimators/hand",
    "estimators/data",
    "tests/stored.py",
)
P = ParamSpec("P")
T = TypeVar("T")


def stored_once(make: Callable[P, T]) -> Callable[P, T]:
    """Keep what `make` gives in a file named by its arguments and by the sources it depends on; `make` is deterministic."""

    @cache
    @wraps(make)
    def read_or_make(*args: P.args, **kwargs: P.kwargs) -> T:
        key = repr(
            (
                make.__module__,
                make.__qualname__,
                _code_of(make),
                _sources(),
                args,
                sorted(kwargs.items()),
            )
        )
        file = FOLDER / f"{hashlib.sha256(key.encode()).hexdigest()}.pickle"
        if file.is_file():
            value: T = pickle.loads(file.read_bytes())
            return value
        value = make(*args, **kwargs)
        FOLDER.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
        partial.replace(file)  # another process may have made the same meanwhile
        return value

    return read_or_make


def _code_of(make: Callable[..., object]) -> str:
    code = make.__code__
    return hashlib.sha256(code.co_code + repr(code.co_consts).encode()).hexdigest()


@cache
def _sources() -> str:
    """A hash of every file that a simulated recording depends on."""
    files = sorted(
        f for s in SOURCES for f in ([ROOT / s] if s.endswith(".py") else (ROOT / s).rglob("*.py"))
    )
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()
