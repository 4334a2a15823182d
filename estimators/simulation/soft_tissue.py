"""How skin follows the joint under it: the flexion that a sensor's turn and slide are proportional to.

In      flexions (n, sensors) rad with their first and second derivatives, at instants t (n,) s
Out     the effective flexions with theirs
Source  ours: the first-order model (proportional), and what tissue does beside it: more at large angles, later, only after some bending
Limits  the memory of `delayed` and `sticking` begins with each stretch of samples; `sticking` starts and stops moving within one sample
"""

from collections.abc import Callable, Mapping

import numpy as np

from handscope.estimators.numerics.typing import Array

RIGHT_ANGLE = np.pi / 2
DELAY = 0.2  # s, time constant
PLAY = np.radians(10.0)  # rad by which a joint bends back before the skin follows
Flexion = tuple[Array, Array, Array]  # with its derivatives


def follow(law: str, t: Array, flexion: Flexion) -> Flexion:
    """The effective flexion; every law gives 90 deg where a joint goes straight to 90 deg and stays, `sticking` less by its play."""
    return LAWS[law](t, flexion)


def _proportional(t: Array, flexion: Flexion) -> Flexion:
    return flexion


def _quadratic(t: Array, flexion: Flexion) -> Flexion:
    """The square of the angle, with its sign."""
    f, df, ddf = flexion
    size, sign = np.abs(f), np.sign(f)
    return (
        f * size / RIGHT_ANGLE,
        2 * size * df / RIGHT_ANGLE,
        (2 * size * ddf + 2 * sign * df**2) / RIGHT_ANGLE,
    )


def _delay(t: Array, flexion: Flexion) -> Flexion:
    """A first-order lag, exact for flexion that is linear between samples."""
    f, df, _ = flexion
    y = f.copy()
    for k in range(1, len(t)):
        dt = t[k] - t[k - 1]
        kept, slope = np.exp(-dt / DELAY), (f[k] - f[k - 1]) / dt
        y[k] = f[k] - DELAY * slope + kept * (y[k - 1] - f[k - 1] + DELAY * slope)
    dy = (f - y) / DELAY
    return y, dy, (df - dy) / DELAY


def _sticking(t: Array, flexion: Flexion) -> Flexion:
    """A play: the skin stays where it is until the joint has bent on or back by PLAY."""
    f, df, ddf = flexion
    y, moves = f.copy(), np.zeros(f.shape, bool)
    for k in range(1, len(t)):
        y[k] = np.clip(y[k - 1], f[k] - PLAY, f[k] + PLAY)
        moves[k] = y[k] != y[k - 1]
    return y, np.where(moves, df, 0.0), np.where(moves, ddf, 0.0)


LAWS: Mapping[str, Callable[[Array, Flexion], Flexion]] = {
    "proportional": _proportional,
    "quadratic": _quadratic,
    "delayed": _delay,
    "sticking": _sticking,
}
