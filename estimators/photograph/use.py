"""What a photograph's figures become: lengths of a patient's hand, columns of the pose's event.

In      Figures
Out     entries of the contract's HandGeometry, m; details of an `initial_pose` event, deg
Source  docs/motion-bids.md
Limits  nothing of the thumb's CMC joint goes to the geometry: no crease shows it from above, and
        what is derived from the palm is surer
"""

from typing import Any

import numpy as np

from handscope.estimators.photograph.hand_figures import Figures

UNSEEN = ("thumb_metacarpal", "thumb_cmc")


def geometry_entries(figures: Figures) -> dict[str, Any]:
    """Palm, phalanges and MCP joints, m, rounded to a hundredth of a millimetre."""
    lengths = {
        "palm_length" if name == "hand" else name: round(value, 5)
        for name, value in figures.lengths.items()
        if name not in UNSEEN
    }
    positions = {
        joint: [round(x, 5) for x in place]
        for joint, place in figures.joint_positions.items()
        if joint not in UNSEEN
    }
    return {**lengths, "joint_positions": positions}


def pose_details(figures: Figures) -> dict[str, float]:
    """The deviations with their standard deviations, deg, by column of the event."""
    found = {}
    for joint, angle in figures.deviation.items():
        found[f"{joint}_deviation_deg"] = round(float(np.degrees(angle)), 2)
        found[f"{joint}_deviation_sd_deg"] = round(
            float(np.degrees(figures.deviation_sd[joint])), 2
        )
    return found
