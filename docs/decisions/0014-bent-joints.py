"""How often joints that were bent in the initial pose are told (decision 0014).

Run     PYTHONPATH=. python docs/decisions/0014-bent-joints.py, from the repository; a minute
Out     share of simulated poses of which a bent joint is told: of intact ones, and of those with bent joints
"""

import sys

import numpy as np

from handscope.estimators.finger_ekf.pose_error import bent_joints
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentParams
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF
from handscope.estimators.recording_checks.pose_gravity import LEAST
from tests.estimators.finger_ekf.test_pose_inference import taken
from tests.simulated import DEG

LONG = FINGERS[1:]
INTACT = ((4.5, 2.5), (4.5, 5.0), (8.0, 3.0), (10.0, 3.0), (3.0, 6.0))  # deg: misaligned, missed
BENT = {
    "one PIP joint by 20 deg": {"index_pip": 20.0},
    "one PIP joint by 30 deg": {"index_pip": 30.0},
    "one PIP joint by 40 deg": {"index_pip": 40.0},
    "one MCP joint by 30 deg": {"ring_mcp": 30.0},
    "one DIP joint by 30 deg": {"ring_dip": 30.0},
    "all PIP joints by 20 deg": {f"{f}_pip": 20.0 for f in LONG},
    "all MCP joints by 20 deg": {f"{f}_mcp": 20.0 for f in LONG},
    "long fingers by 15 deg a joint": {
        f"{f}_{j}": 15.0 for f in LONG for j in ("mcp", "pip", "dip")
    },
}


def told(misaligned: float, missed: float, bent: dict[str, float], count: int) -> float:
    """Share of poses of which a bent joint is told."""
    rng, params, found = np.random.default_rng(14), SensorToSegmentParams(), 0
    for _ in range(count):
        flexions = {joint: angle * DEG for joint, angle in bent.items()}
        calibration, _, _ = taken(rng, misaligned * DEG, missed * DEG * IS_DOF, flexions)
        found += any(abs(b.angle) > LEAST for b in bent_joints.find(params, calibration))
    return found / count


for misaligned, missed in INTACT:
    sys.stdout.write(
        f"sensors {misaligned:g}, pose {missed:g} deg: {told(misaligned, missed, {}, 500):.1%} of 500\n"
    )
for name, bent in BENT.items():
    sys.stdout.write(f"{name}: {told(4.5, 3.0, bent, 100):.0%} of 100" + "\n")
