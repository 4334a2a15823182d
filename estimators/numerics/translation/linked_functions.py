"""Functions that kernels call, translated to what a kernel links and optimises with its own code, and to nothing else.

numba would optimise each such function with all that it calls, and make machine code of it that nobody runs: the magnet's loop alone has a hundred of
them, four levels deep. What a kernel computes is the same to the bit. Limits: of numba's internals it takes the compiler's pipeline and its library
of code (numba 0.68); a function that Python calls, too, is translated for it anew.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

OPTIONS = {"error_model": "numpy"}


class LinkedFunction(CPUDispatcher):  # type: ignore[misc]
    """A function for kernels; Python may call it, too."""

    def __init__(self, function: Callable[..., Any]) -> None:
        options = {"nopython": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        super().__init__(function, targetoptions=OPTIONS | options, pipeline_class=_Pipeline)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self._for_python(*arguments)

    @cached_property
    def _for_python(self) -> Callable[..., Any]:
        compiled: Callable[..., Any] = njit(**OPTIONS)(self.py_func)
        return compiled


class _Pipeline(Compiler):  # type: ignore[misc]
    def define_pipelines(self) -> Any:
        """As numba's, into a library without machine code."""
        state = self.state
        state.library = _LinkedCode(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()


class _NoEnvironment:
    def set_env(self, name: str, environment: object) -> None:
        """There is no code that would read it."""


class _LinkedCode(JITCodeLibrary):  # type: ignore[misc]
    """What is lowered, not yet optimised as a whole; callers link it."""

    codegen = _NoEnvironment()

    def _optimize_final_module(self) -> None:
        """That is the caller's part."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0
