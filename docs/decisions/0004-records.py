"""Three ways to pass what a filter knows to its kernel: positions in arrays, NamedTuples, structured
arrays; processor's time of a step, of a call and of the translation."""

import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.typing import Array

STEPS, CALLS, REPEATS = 3_000_000, 20_000, 7


class Monitor(NamedTuple):
    """As the magnet filter's, shorter."""

    mean: float
    lost: float
    silent: float
    delay: float


class Motion(NamedTuple):
    """As the magnet filter's kinematics, shorter."""

    w: Array  # (3,)
    alpha: Array
    f: Array
    v: Array


MONITOR = np.dtype([(name, float) for name in Monitor._fields])
MOTION = np.dtype([(name, float, (3,)) for name in Motion._fields])


@inlined
def _by_positions(m: Array, k: Array, steps: int) -> float:
    for _ in range(steps):
        for i in range(3):
            k[i] += 0.1 * (k[6 + i] - k[i])
            k[3 + i] += 0.1 * (k[i] - k[3 + i])
            k[9 + i] += 0.01 * k[6 + i]
        m[0] += 0.1 * (k[0] * k[0] + k[10] - m[0])
        m[1] = m[1] + 0.01 if m[0] > 3 else 0.0
        m[2], m[3] = m[2] + 0.01, m[3] - 0.01
    out: float = m[0]
    return out


@inlined
def _move(k: Any) -> None:
    for i in range(3):
        k.w[i] += 0.1 * (k.f[i] - k.w[i])
        k.alpha[i] += 0.1 * (k.w[i] - k.alpha[i])
        k.v[i] += 0.01 * k.f[i]


@inlined
def _by_tuples(m: Monitor, k: Motion, steps: int) -> float:
    for _ in range(steps):
        _move(k)
        mean = m.mean + 0.1 * (k.w[0] * k.w[0] + k.v[1] - m.mean)
        m = Monitor(mean, m.lost + 0.01 if mean > 3 else 0.0, m.silent + 0.01, m.delay - 0.01)
    return m.mean


@inlined
def _by_structures(ms: Any, ks: Any, steps: int) -> float:
    m, k = ms[0], ks[0]
    for _ in range(steps):
        _move(k)
        m.mean += 0.1 * (k.w[0] * k.w[0] + k.v[1] - m.mean)
        m.lost = m.lost + 0.01 if m.mean > 3 else 0.0
        m.silent, m.delay = m.silent + 0.01, m.delay - 0.01
    out: float = m.mean
    return out


def measure(kernel: Callable[..., float], made: Callable[[], tuple[Any, Any]]) -> str:
    """Times of one way, and what it computes."""
    begun = time.process_time()
    kernel(*made(), 1)
    translated, steps = time.process_time() - begun, []
    for _ in range(REPEATS):
        arrays, begun = made(), time.process_time()
        found = kernel(*arrays, STEPS)
        steps.append(time.process_time() - begun)
    begun = time.process_time()
    for _ in range(CALLS):
        kernel(*arrays, 0)
    call = (time.process_time() - begun) / CALLS
    step = 1e9 * min(steps) / STEPS
    return f"{translated:.2f} s, {step:.1f} ns a step, {1e6 * call:.1f} us a call: {found!r}\n"


if __name__ == "__main__":
    START = np.random.default_rng(0).normal(size=(4, 3))
    WAYS: dict[str, tuple[Callable[..., float], Callable[[], tuple[Any, Any]]]] = {
        "positions": (_by_positions, lambda: (np.array([1.0, 0, 0, 0]), START.ravel().copy())),
        "NamedTuple": (_by_tuples, lambda: (Monitor(1.0, 0.0, 0.0, 0.0), Motion(*START.copy()))),
        "structured": (
            _by_structures,
            lambda: (np.array([(1.0, 0, 0, 0)], MONITOR), START.ravel().copy().view(MOTION)),
        ),
    }
    for way, (kernel, made) in WAYS.items():
        sys.stdout.write(f"{way}: {measure(kernel, made)}")
