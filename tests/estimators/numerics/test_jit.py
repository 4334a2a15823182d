"""What is compiled is kept on disk: it must be known by everything that it was made of."""

import math
from collections.abc import Callable
from typing import Any

from numba import njit

from handscope.estimators.numerics.jit import called_by, inlined


def _kernel(of_angle: Callable[..., Any], factor: float) -> Callable[..., Any]:
    """A kernel in a module of its own, which calls one function and takes one number."""
    scope: dict[str, Any] = {"of_angle": of_angle, "FACTOR": factor, "math": math}
    exec("def kernel(x, y):\n    y[0] = FACTOR * of_angle(x[0]) * math.pi", scope)
    return scope["kernel"]  # type: ignore[no-any-return]


def test_a_kernel_is_another_when_a_function_or_a_number_that_it_takes_is_another() -> None:
    sine, twice = inlined(lambda x: math.sin(x)), inlined(lambda x: 2 * math.sin(x))
    kept = [
        list(called_by(_kernel(*taken)))
        for taken in ((sine, 1.0), (twice, 1.0), (sine, 2.0), (sine, 1.0))
    ]
    assert kept[0] == kept[3]
    assert kept[0] not in kept[1:3]


def test_a_kernel_is_another_when_a_function_takes_another_field_of_a_record() -> None:
    """The code of a function has names by their places: both read the first one."""
    one, other = inlined(lambda r: r.tau), inlined(lambda r: r.age)
    assert list(called_by(_kernel(one, 1.0))) != list(called_by(_kernel(other, 1.0)))


def test_a_function_of_kernels_has_no_machine_code_of_its_own_until_python_calls_it() -> None:
    """A kernel optimises what it links; machine code of each function would be made for nobody."""
    sine = inlined(lambda x: math.sin(x))
    kernel = looped_in_memory(sine)
    assert kernel(0.5) == 2 * math.sin(0.5)
    (made,) = sine.overloads.values()  # type: ignore[attr-defined]
    assert "define" in made.library.get_llvm_str()
    assert made.library.get_pointer_to_function(made.fndesc.llvm_func_name) == 0
    assert sine(0.5) == math.sin(0.5)


def looped_in_memory(function: Callable[..., Any]) -> Callable[..., Any]:
    """A kernel that calls a function, not kept on disk."""
    compiled: Callable[..., Any] = njit(lambda x: 2 * function(x))
    return compiled
