"""Balance of the grip forces of all fingertips: a finger without a sensor that carries part of the load leaves a residual along the grip axis.

In      of S tips at n instants of one grasp: forces (n, S, 3) N as corrected, specific force (n, S, 3) m/s^2, both in the global frame, the thumb or whoever
        pushes against the others first; covariance (n, 3S, 3S) of the tips' turns, standard deviation (n, S) N of noise and zero, share (S,) by which each scale may be wrong
Out     the rest, N, and its standard deviation, over the whole grasp
Source  Kortier, thesis (6.13): the net horizontal force of what is held is zero; looked at along the push alone, ours: a tip that is turned wrong turns its
        force and leaves the sum along it alone, so that nothing but zeros and scales explains a rest there
Limits  with scales wrong by 2 % and zeros by 0.1 N each a tenth of the load carried by a third finger is at the edge of what can be seen; a third finger that
        pushes across the line is tip_orientation.py's
"""

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LEAST = 0.5  # N: smaller forces are not used


def residual_along_push(
    force: Array, acc: Array, covariance: Array, sd: Array, scale: float | Array
) -> tuple[float, float]:
    """Mean of the net force along the horizontal part of the push, and its standard deviation, N; NaN where no fingers push against each other."""
    S = force.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        up = np.nansum(acc, axis=1)
        up = up / np.linalg.norm(up, axis=1, keepdims=True)
        push = force[:, 0] - force[:, 1:].sum(axis=1)
        level = push - (push * up).sum(axis=1, keepdims=True) * up
        size = np.linalg.norm(level, axis=1, keepdims=True)
        along = level / size
    used = (
        (size[:, 0] > LEAST) & np.isfinite(along).all(axis=1) & np.isfinite(force).all(axis=(1, 2))
    )
    if S < 2 or used.sum() < 8:
        return np.nan, np.nan
    along, force = along[used], force[used]
    each = np.einsum("ni,nsi->ns", along, force)
    turned = np.einsum("ni,nsij->nsj", along, -quat.skew(force)).reshape(len(along), 3 * S)
    of_turns = np.einsum("ni,nij,nj->n", turned, covariance[used], turned).mean()
    of_scales = (scale * each.mean(axis=0)) @ (scale * each.mean(axis=0))
    of_zeros = (sd[used] ** 2).mean(axis=0).sum()
    return float(each.sum(axis=1).mean()), float(np.sqrt(of_scales + of_zeros + of_turns))
