"""What the finger filter takes: samples of the four sensors of every chain on one time base.

In      rows of n instants, F chains
Out     the same by name, and parts of them
Source  ours; sample_alignment.py fills them
"""

from dataclasses import dataclass

from handscope.estimators.finger_ekf.joint_acceleration.block_sums import Readings
from handscope.estimators.numerics.typing import Array, Bools


@dataclass(frozen=True)
class Samples:
    """Aligned samples of F chains."""

    t: Array  # (n,) s
    # (n, F, 4, 3) rad, rotation since the sample before as a vector in the sensor's frame; 0 where
    # nothing is known
    turn: Array
    bias_time: Array  # (n, F, 4) s of the gyroscope's bias that is in `turn`
    # (n, F, 4, 3) m/s^2, specific force, or gravity as the sensor's own fusion sees it; NaN where
    # it must not be used
    acc: Array
    rotation_variance: Array  # (n, F, 4) rad^2, variance of what `turn` may have missed
    known: Bools  # (n, F, 3) both segments of the joint are measured
    q_first: Array  # (n, F, 3, 4) q_pc to start a joint from that was not known before
    # (n, F, 2, 3) uT, fields at the chain's first and last sensor, NaN where not known; None: not
    # asked for
    mag: Array | None = None
    # specific forces and orientations of the hand's and the thumb metacarpal's sensor; None: not asked for
    at_joint: Readings | None = None

    def __len__(self) -> int:
        return len(self.t)

    def between(self, part: slice) -> "Samples":
        """Some of the rows."""
        return Samples(
            self.t[part],
            self.turn[part],
            self.bias_time[part],
            self.acc[part],
            self.rotation_variance[part],
            self.known[part],
            self.q_first[part],
            None if self.mag is None else self.mag[part],
            None
            if self.at_joint is None
            else Readings(*(of_rows[part] for of_rows in self.at_joint)),
        )
