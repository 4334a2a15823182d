"""M1: as M2, with magnetometers keeping the headings that the pose gave.

In      inertial and magnetic blocks of any subset of sensors (the hand's is needed), a Calibration
        from the initial pose
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame
Source  Salchow-Hoemmen 2019, 2.4, method M1: (17), (19)-(22), (23)-(27)
Limits  as good as the magnetic field is homogeneous: near steel or devices the headings follow the
        disturbance
"""

from dataclasses import dataclass
from typing import ClassVar

from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import fusion_pipeline
from handscope.estimators.methods.fusion_pipeline import State as State
from handscope.estimators.methods.fusion_pipeline import finish as finish
from handscope.estimators.methods.fusion_pipeline import release as release
from handscope.estimators.methods.fusion_pipeline import start as start
from handscope.estimators.methods.fusion_pipeline import step as step
from handscope.estimators.pipeline.method import Capabilities

TITLE = phrase("method_title.m1")
CAPABILITIES = Capabilities(needs_pose=True, needs_magnetometers=True, takes_orientations=True)


@dataclass(frozen=True, kw_only=True)
class Params(fusion_pipeline.Params):
    """Options of M1."""

    MAGNETOMETER: ClassVar[bool] = True
