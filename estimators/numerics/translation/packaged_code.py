"""Machine code that comes with an installed package: `make dist` translates it for a class of processors rather than for one model (setup.py).

numba keeps code under the model of processor that it was translated for, and takes no other model's. No kernel reorders sums or fuses products with
sums (numerics/jit.py), so that code for the class computes the same to the bit on every model of it. Who has an older processor, another Python or
another numba translates, as from the source. Limits: of numba's internals it takes what names kept code (numba 0.68).
"""

import json
import platform
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import ll
from numba.core.registry import cpu_target

FOLDER = "machine_code"
ABOUT = "about.json"


def gather(package: Path) -> None:
    """Move what this process kept beside the modules of a package into its folder of machine code."""
    for kept in sorted(package.glob("**/__pycache__/*.nb[ic]")):
        place = package / FOLDER / kept.parent.parent.relative_to(package) / kept.name
        place.parent.mkdir(parents=True, exist_ok=True)
        kept.rename(place)
    processor = cpu_target.target_context.codegen().magic_tuple()
    (package / FOLDER / ABOUT).write_text(json.dumps({"for": _here(), "processor": processor}))


def is_for_this_machine(package: Path) -> bool:
    """Whether a package brings machine code that this processor, Python and numba can use."""
    return _processor(package) is not None


def load(kept: Any, signature: Any, context: Any) -> Any:
    """What its package brings of a kernel, by the cache in which numba would keep it; None where it brings nothing for this machine."""
    function = kept._py_func
    package, within = _place(function.__module__, Path(function.__code__.co_filename))
    if (processor := _processor(package)) is None:
        return None
    base, stamp = kept._impl.filename_base, kept._cache_file._source_stamp
    file = IndexDataCacheFile(str(package / FOLDER / within), base, stamp)
    code = file.load(kept._index_key(signature, SimpleNamespace(magic_tuple=lambda: processor)))
    return None if code is None else kept._impl.rebuild(context, code)


def _place(module: str, file: Path) -> tuple[Path, Path]:
    """The folder of the package that a module is in, and the module's own within it."""
    package = file.parents[module.count(".") - 1] if "." in module else file.parent
    return package, file.parent.relative_to(package)


@cache
def _processor(package: Path) -> tuple[str, ...] | None:
    """What numba calls the processors that a package brings code for; None where this machine has none of them."""
    try:
        about = json.loads((package / FOLDER / ABOUT).read_text())
    except OSError:
        return None
    processor = tuple(about["processor"])
    has = ll.get_host_cpu_features()
    can = all(has.get(name.removeprefix("+")) for name in processor[-1].split(",") if name)
    return processor if can and about["for"] == _here() else None


def _here() -> dict[str, str]:
    version = ".".join(platform.python_version_tuple()[:2])
    return {"machine": platform.machine(), "python": version, "numba": numba.__version__}
