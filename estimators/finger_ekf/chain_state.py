"""What the finger filter knows of its chains, as records that its compiled kernels take.

A field of F chains has their axis first; `window_of`, `joints_of` and `chain_of` give views of one chain, whose entries a
kernel may change.
Source  as filter.py, whose State holds these arrays
"""

from typing import NamedTuple

from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.typing import Array

SINCE, BEGUN, NEWEST, HALVES = 0, 1, 2, 3  # of stay_clock


class Window(NamedTuple):
    """What the four sensors of each chain did since the newest update."""

    delta_q: Array  # (F, 4, 4) rotation of each sensor
    J_bias: Array  # (F, 4, 3, 3) its derivative by the bias: T(b + db) = T exp(J db)
    bias_time: Array  # (F, 4) s, time over which the biases are in it
    rotation_variance: Array  # (F, 4) rad^2, variance from gaps


class Joints(NamedTuple):
    """What is known beforehand of the three joints of each chain; yes is 1."""

    known: Array  # (F, 3) the joint has a rotation
    free: Array  # (F, 3, 3) it has flexion, deviation, pronation
    limits: Array  # (F, 3, 3, 2) rad


class ChainState(NamedTuple):
    """What an update changes: means, the covariance of their errors, and statistics of the updates so far; filter.State tells shapes and units."""

    q_pc: Array
    bias: Array
    q_SB: Array
    soft_tissue_gain: Array
    field_difference: Array
    P: Array
    up: Array
    rest_time: Array
    rest_rotation: Array
    previous_rest_rate: Array
    rest_rate_scatter: Array
    stay_clock: Array
    stay_rotation: Array
    stay_time: Array
    stay_sums: Array
    mean_square_rate: Array
    initial_vertical: Array
    current_vertical: Array
    compliance_stats: Array
    reference_compliance: Array
    mounting_score: Array
    mounting_information: Array


@inlined
def window_of(window: Window, f: int) -> Window:
    """Of chain f."""
    return Window(
        window.delta_q[f], window.J_bias[f], window.bias_time[f], window.rotation_variance[f]
    )


@inlined
def joints_of(joints: Joints, f: int) -> Joints:
    """Of chain f."""
    return Joints(joints.known[f], joints.free[f], joints.limits[f])


@inlined
def chain_of(chains: ChainState, f: int) -> ChainState:
    """Of chain f."""
    return ChainState(
        chains.q_pc[f],
        chains.bias[f],
        chains.q_SB[f],
        chains.soft_tissue_gain[f],
        chains.field_difference[f],
        chains.P[f],
        chains.up[f],
        chains.rest_time[f],
        chains.rest_rotation[f],
        chains.previous_rest_rate[f],
        chains.rest_rate_scatter[f],
        chains.stay_clock[f],
        chains.stay_rotation[f],
        chains.stay_time[f],
        chains.stay_sums[f],
        chains.mean_square_rate[f],
        chains.initial_vertical[f],
        chains.current_vertical[f],
        chains.compliance_stats[f],
        chains.reference_compliance[f],
        chains.mounting_score[f],
        chains.mounting_information[f],
    )
