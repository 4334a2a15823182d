"""Kept machine code is loaded without what numba needs to translate.

numba fills its tables of what it can translate, half a hundred modules with `scipy.linalg` among them, before it looks for kept
code: 0.1 s of every start. With the machine code of a kernel it reads the LLVM code that other kernels would link, and lists its symbols
twice: 0.1 s and 20 MB for the kernels of a recording. What was kept needs neither; who translates fills the tables first, and reads the LLVM
code of what a new kernel links. Limits: of numba's internals it takes the classes that keep code and that hold it (numba 0.68).
"""

from importlib import import_module
from typing import Any

from numba.core import environment
from numba.core.caching import Cache
from numba.core.codegen import JITCodeLibrary, ll
from numba.core.runtime import rtsys

from handscope.estimators.numerics.translation import packaged_code

_unserialize_all = JITCodeLibrary._unserialize


def load_without_translator() -> None:
    """From now on, in this process."""
    Cache.load_overload = _load_overload
    JITCodeLibrary._unserialize = staticmethod(_unserialize)
    replaced = environment._rebuild_env
    # kept code names it: as numba alone would
    _rebuild_environment.__module__ = replaced.__module__
    _rebuild_environment.__qualname__ = _rebuild_environment.__name__ = replaced.__name__
    environment._rebuild_env = _rebuild_environment


class _KeptLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A kernel's machine code, and its LLVM code to be read when another one links it."""

    _shared_module: Any  # the LLVM code once it was read

    def take(self, machine_code: bytes, llvm_code: bytes) -> None:
        """The code as it was kept."""
        self._machine_code, self._llvm_code = machine_code, llvm_code
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """0 where this code has no such function; LLVM ends the process where it is asked for one that is nowhere."""
        if name.encode() + b"\0" not in self._machine_code:  # names in its table of symbols
            return 0
        return int(self._codegen._engine.get_function_address(name))

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = ll.parse_bitcode(self._llvm_code)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return self._shared_module


def _load_overload(self: Any, signature: Any, target_context: Any) -> Any:
    """As `Cache.load_overload`, which refreshes the context in place of the first line, and knows of no code that a package brings; None where nothing
    is kept."""
    rtsys.initialize(target_context)
    with self._guard_against_spurious_io_errors():
        if (brought := packaged_code.load(self, signature, target_context)) is not None:
            return brought
        return self._load_overload(signature, target_context)


def _unserialize(codegen: Any, state: tuple[str, str, Any]) -> Any:
    """As `CPUCodeLibrary._unserialize`."""
    name, kind, code = state
    if kind != "object" or codegen._library_class is not JITCodeLibrary:
        return _unserialize_all(codegen, state)
    library = _KeptLibrary(codegen, name)
    library.take(*code)
    return library


def _rebuild_environment(module: str, constants: list[Any], name: str) -> environment.Environment:
    """As `environment._rebuild_env`; the globals of numba's own modules, which only code that was not translated would read, are not imported."""
    if (known := environment.lookup_environment(name)) is not None:
        return known
    is_numba = module.partition(".")[0] == "numba"
    scope = {"__name__": module} if is_numba else vars(import_module(module))
    env = environment.Environment(scope)
    env.consts[:] = constants
    env.env_name = name
    environment.Environment._memo[name] = env
    return env
