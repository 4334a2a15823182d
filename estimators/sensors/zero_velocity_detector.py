"""Whether a sensor stands still: generalized likelihood ratio test on a short window of
accelerations and angular rates.

Source  Skog, Handel, Nilsson & Rantakokko 2010, IEEE Trans Biomed Eng 57:2657 (SHOE); Kortier's
        thesis 2.2.4 and 5.2.2 use it
Limits  a movement at constant velocity without a turn looks like a standstill; a hand that trembles
        more than the limits never stands still
"""

import math

import numpy as np

from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.jit import rowwise
from handscope.estimators.numerics.typing import Array


def likelihood_ratio(gyr: Array, acc: Array, gyr_sd: float, acc_sd: float) -> float:
    """The test's statistic of a window: rates gyr (n, 3) rad/s without bias, specific forces acc
    (n, 3) m/s^2; below one (ours) it stands still.

    The mean over the window of |a - g u|^2 / acc_sd^2 + |w|^2 / gyr_sd^2 with u the direction of
    the mean of a.
    """
    mean = acc.mean(axis=0)
    up = mean / max(float(np.sqrt(mean @ mean)), 1e-9)
    off, rate = acc - GRAVITY * up, gyr
    return float((off * off).sum() / acc_sd**2 + (rate * rate).sum() / gyr_sd**2) / len(acc)


def likelihood_ratios(gyr: Array, acc: Array, gyr_sd: float, acc_sd: float) -> Array:
    """The same of many windows (windows, n, 3) at once; a window with a missing sample is NaN."""
    return _ratio(gyr, acc, gyr_sd, acc_sd)


@rowwise("(n,v),(n,v),(),()->()")
def _ratio(gyr: Array, acc: Array, gyr_sd: float, acc_sd: float, ratio: Array) -> None:
    mean = np.zeros(3)
    for k in range(len(acc)):
        for i in range(3):
            mean[i] += acc[k, i] / len(acc)
    length = max(math.sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]), 1e-9)
    total = 0.0
    for k in range(len(acc)):
        for i in range(3):
            total += ((acc[k, i] - GRAVITY * mean[i] / length) / acc_sd) ** 2 + (
                gyr[k, i] / gyr_sd
            ) ** 2
    ratio[0] = total / len(acc)
