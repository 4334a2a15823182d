"""Order of sensors along a finger from their movement alone: two sensors at one joint have a point in common.

In      even readings of a chain's sensors, one behind the other
Out     the order from the hand on in which they meet best, where that is clearly not the chain's own
Source  ours; how well two sensors meet: initialisation.fit_joint
Limits  asked only of what could not be calibrated. Read from its other end a chain meets as well: the hand is taken to turn less than the last phalanx
"""

import itertools

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration.problem import Chain, Noise, Readings

CLEARLY = 10.0  # times as badly as in the best order neighbours must meet, all pairs multiplied: slow fingers in their own order 6


def find_sensor_order(
    chain: Chain, noise: Noise, readings: Readings, flexing: Array
) -> tuple[str, ...]:
    """The sensors in the order in which they hang together; nothing where that is the chain's, or not clearly another, or the chain has branches. `flexing` (S, 3) as of `Problem`."""
    S = len(chain.sensors)
    speed = np.linalg.norm(readings.gyr, axis=2).mean(axis=0)
    if S < 3 or list(chain.parents) != list(range(S - 1)) or (np.diff(speed) > 0).all():
        return ()
    q_GS, residual = self_calibration_initialisation.fuse_sensors(readings), np.zeros((S, S))
    for i, j in itertools.combinations(range(S), 2):
        residual[i, j] = residual[j, i] = np.log(
            self_calibration_initialisation.fit_joint(noise, readings, q_GS, i, j, flexing)[0]
        )
    cost = {
        order: sum(residual[a, b] for a, b in itertools.pairwise(order))
        for order in itertools.permutations(range(S))
    }
    best = min(cost, key=lambda order: cost[order])
    best = best if speed[best[0]] < speed[best[-1]] else best[::-1]
    own = tuple(range(S))
    return (
        tuple(chain.sensors[s] for s in best)
        if best != own and cost[own] - cost[best] > np.log(CLEARLY)
        else ()
    )
