"""How skin is shared between the bones on either side of a joint."""

import numpy as np

from handscope.estimators.numerics.typing import Array


def through(t: Array, centre: float, width: float) -> Array:
    """0 before a joint and 1 beyond it, smooth over `width` round its centre: t (...) -> (...)."""
    s = np.clip(0.5 + (t - centre) / width, 0.0, 1.0)
    return np.asarray(s * s * (3 - 2 * s))


def hinge(blend: Array) -> tuple[Array, Array, Array]:
    """Weights of parent, half-way bone and child for a blend (...) that goes from 0 (parent) to 1 (child): they sum to 1."""
    parent, child = np.maximum(1 - 2 * blend, 0.0), np.maximum(2 * blend - 1, 0.0)
    return parent, 1.0 - parent - child, child
