"""B, the baseline: orientations of the sensors from gyroscope, accelerometer and magnetometer,
taken as those of the segments.

In      inertial and magnetic blocks of any subset of sensors, a Calibration with the nominal
        mounting
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame
Source  Salchow-Hoemmen 2019, 2.4, method B: (17), (19)-(22), (23)-(27), without initial pose and
        joint constraints; Valtin 2017, (1)-(5)
Limits  a misaligned sensor or a field that is not homogeneous becomes an error of the angles
"""

from dataclasses import dataclass
from typing import ClassVar

from handscope.estimators.data.options import option
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import fusion_pipeline
from handscope.estimators.methods.fusion_pipeline import State as State
from handscope.estimators.methods.fusion_pipeline import finish as finish
from handscope.estimators.methods.fusion_pipeline import release as release
from handscope.estimators.methods.fusion_pipeline import start as start
from handscope.estimators.methods.fusion_pipeline import step as step
from handscope.estimators.pipeline.method import Capabilities

TITLE = phrase("method_title.b")
CAPABILITIES = Capabilities(needs_pose=False, needs_magnetometers=True, takes_orientations=True)


@dataclass(frozen=True, kw_only=True)
class Params(fusion_pipeline.Params):
    """Options of B."""

    MAGNETOMETER: ClassVar[bool] = True
    constraints: bool = option(
        False,
        "",
        "zero the angles that are no freedom of their joint and clip the rest to the permitted range",
        "Salchow-Hoemmen 2019, 2.4.3: only M1 and M2",
    )
    mag_rejection: bool = option(
        False,
        "",
        "leave the magnetometer out while its field differs in strength or dip from the one learnt",
        "the paper's filter has none; without a pose to start from it costs accuracy in an undisturbed field",
    )
