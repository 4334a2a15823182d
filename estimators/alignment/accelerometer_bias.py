"""Biases of accelerometers that an earlier recording showed: taken off samples, and off a pose that was looked at with them.

In      biases (3,) m/s^2 by sensor, of self-calibration
Out     the same samples and pose as of accelerometers without bias
Source  a bias b tilts the vertical u of a sensor that rests by u x b / g
Limits  biases change with temperature: they hold as long as the glove is not taken off
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import ACC, Block
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import make_upright

UP = np.array([0.0, 0.0, 1.0])


def subtract(block: Block, biases: Mapping[str, Array]) -> Block:
    """The samples without biases; of a block without any of these sensors itself."""
    known = [k for k, s in enumerate(block.stream.sensors) if s in biases]
    if not known or ACC not in block.stream.quantities:
        return block
    values, axes = block.values.copy(), block.stream.axes(ACC)
    for k in known:
        values[:, k, axes] -= biases[block.stream.sensors[k]]
    return replace(block, values=values)


def correct_pose(pose: Calibration, biases: Mapping[str, Array]) -> Calibration:
    """The pose of sensors without biases, which the method is to subtract: they stand as gravity alone shows them, segments as the pose had them."""
    q_GS, q_BS = dict(pose.q_GS), dict(pose.q_BS)
    for s in biases.keys() & q_GS.keys() & q_BS.keys():
        read = GRAVITY * quat.rotate(quat.conjugate(q_GS[s]), UP)
        q_GB = quat.multiply(q_GS[s], quat.conjugate(q_BS[s]))
        q_GS[s] = make_upright(q_GS[s], read - biases[s])
        q_BS[s] = quat.relative(q_GB, q_GS[s])
    return replace(pose, q_GS=q_GS, q_BS=q_BS, acc_bias={**pose.acc_bias, **biases})
