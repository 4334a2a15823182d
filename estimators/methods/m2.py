"""M2: the hand from gyroscopes and accelerometers alone, its headings from one pose.

In      inertial blocks of any subset of sensors (the hand's is needed), a Calibration from the
        initial pose
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame
Source  Salchow-Hoemmen 2019, 2.4, method M2: (18), (19)-(22), (23)-(27)
Limits  headings drift with what is left of the gyroscopes' biases; joint constraints hide, not
        heal, an error within the permitted range
"""

from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods.fusion_pipeline import Params as Params
from handscope.estimators.methods.fusion_pipeline import State as State
from handscope.estimators.methods.fusion_pipeline import finish as finish
from handscope.estimators.methods.fusion_pipeline import release as release
from handscope.estimators.methods.fusion_pipeline import start as start
from handscope.estimators.methods.fusion_pipeline import step as step
from handscope.estimators.pipeline.method import Capabilities

TITLE = phrase("method_title.m2")
CAPABILITIES = Capabilities(needs_pose=True, takes_orientations=True)
