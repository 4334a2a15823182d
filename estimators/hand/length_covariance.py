"""How far the lengths of a sized hand may be off, and which of a finger err together: that follows
from what was measured.

In      a sized hand, with the names of what was measured
Out     for each finger the covariance of what its tip depends on: where its root lies and how long
        its three bones are
Source  a finger whose total was measured leaves its bones only their shares: one that is longer
        makes the others shorter; of a finger derived from the hand's length the total errs, too.
        Ratios of a hand's lengths to each other vary from subject to subject by a few percents:
        Salchow-Hoemmen 2019, 5 (the option `length_sd`); tissue at the tip: ibid., Table 3; breadth
        of a hand of given length, 85 +- 3.8 mm: ANSUR (Gordon et al. 1989), men and women together;
        adults' fingers (index to little) scatter by 6.4 to 8.1 %: Chatzioglou et al. 2024, Anat Cell
        Biol 57:172, 51 people; calipers on hands: technical error of measurement about 1 % of a length
        (doi:10.1177/10519815261458341); palms that are not flat, and where the thumb begins: a hand of
        bones, MyoHand (Caggiano et al. 2022, arXiv:2205.13600), as likely as any between it and a flat palm
Limits  bones measured one by one err each for itself, by `length_sd`, and so does a place of a
        joint that was given; that a hand of which nothing was measured is larger or smaller than
        the average one (by 6 %) shifts all tips equally and is not counted
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import RATIOS, TIP_TISSUE_SD, HandGeometry, root_joint
from handscope.estimators.numerics.typing import Array

NONE_FOUND: Mapping[str, float] = MappingProxyType({})
MEASURED_SD = 1e-3  # m, of a length taken by calipers
BREADTH_SD = 0.045  # of itself, where it was not measured
# of itself, a finger's total that is derived from the palm alone, or from nothing: as fingers scatter
# if they correlate with the palm by 0.5 to 0.6; that correlation is ours
FROM_PALM_SD = 0.06
THUMB_ANGLE_SD = np.radians(3.0)  # of the angle between wrist-MCP 3 and wrist-CMC; size ours
# of the palm's length, dorsal, distal, ulnar: how far roots lie from where ratios put them in a flat
# palm, a uniform distribution up to where MyoHand has them
PLACE_SD: Mapping[str, tuple[float, float, float]] = {
    "thumb": (0.100, 0.095, 0.047),
    "index": (0.005, 0.008, 0.024),
    "middle": (0.0, 0.0, 0.0),
    "ring": (0.039, 0.028, 0.018),
    "little": (0.093, 0.011, 0.069),
}


def covariance(
    geometry: HandGeometry, length_sd: float, found_sd: Mapping[str, float] = NONE_FOUND
) -> Array:
    """(5 fingers, 6, 6): the root's place in the hand's frame, m, then the shares of themselves by
    which the three bones from the root to the tip err; `found_sd` m, of segments whose length was
    found from movement, each for itself."""
    whole = np.array([_of_finger(geometry, finger, length_sd) for finger in FINGERS])
    for own, finger in zip(whole, FINGERS):
        for k, segment in enumerate(CHAINS[finger], start=3):
            if segment in found_sd:
                own[k, :] = own[:, k] = 0.0
                own[k, k] = (found_sd[segment] / geometry.lengths[segment]) ** 2
    return whole


def of_palm(geometry: HandGeometry) -> Array:
    """(5 fingers, 6, 6) as `covariance`: what palms that are not flat add where places of roots were
    not measured. Of tips that are output; contacts are weighed without it (decision 0026)."""
    added = np.zeros((len(FINGERS), 6, 6))
    for own, finger in zip(added, FINGERS):
        if root_joint(finger) not in geometry.measured:
            own[:3, :3] = np.diag(np.square(PLACE_SD[finger])) * geometry.lengths["hand"] ** 2
    return added


def _of_finger(geometry: HandGeometry, finger: str, length_sd: float) -> Array:
    """As the errors of independent causes, one a column, make it."""
    root, bones = _root(geometry, finger, length_sd), _bones(geometry, finger, length_sd)
    return np.block([[root @ root.T, np.zeros((3, 3))], [np.zeros((3, 3)), bones @ bones.T]])


def _root(geometry: HandGeometry, finger: str, length_sd: float) -> Array:
    """How its place errs (3, causes): with its distance from the wrist, with the hand's breadth,
    about the hand's normal."""
    joint = root_joint(finger)
    x, y, z = geometry.joint_positions[joint]
    distance = float(np.hypot(y, z))
    along = (
        MEASURED_SD / distance
        if joint == "middle_mcp" and "palm_length" in geometry.measured
        else length_sd
    )
    if joint in geometry.measured:
        return along * np.array([[x, y, z]]).T
    turned, broad = (
        (THUMB_ANGLE_SD, 0.0)
        if finger == "thumb"
        else (0.0, 0.0 if "hand_breadth" in geometry.measured else BREADTH_SD)
    )
    return np.array(
        [[along * x, along * y, along * z], [0.0, 0.0, broad * z], [0.0, -turned * z, turned * y]]
    ).T


def _bones(geometry: HandGeometry, finger: str, length_sd: float) -> Array:
    """How its bones err, by shares of themselves (3, causes)."""
    chain = CHAINS[finger]
    if geometry.measured & set(chain):
        return length_sd * np.eye(3)
    # the thumb's metacarpal is not counted to its length
    sharing = chain[-len(RATIOS[finger]) - 1 :]
    size = sum(geometry.lengths[s] for s in sharing)
    share = np.array([geometry.lengths[s] / size for s in sharing])
    # a ratio makes all bones before it longer against those behind
    above = np.triu(np.ones((len(share), len(share) - 1)))
    by_ratio = length_sd * (above - share @ above)
    total = (
        np.hypot(MEASURED_SD, TIP_TISSUE_SD[finger]) / size
        if finger in geometry.measured
        else _derived_sd(geometry, length_sd)
    )
    bones = np.column_stack([by_ratio, np.full(len(share), total)])
    if len(sharing) == len(chain):
        return bones
    metacarpal = np.zeros((1, bones.shape[1] + 1))
    metacarpal[0, -1] = length_sd
    return np.vstack([metacarpal, np.column_stack([bones, np.zeros(len(share))])])


def _derived_sd(geometry: HandGeometry, length_sd: float) -> float:
    """Of the total of a finger that was not measured: one ratio away from the hand's length or another finger, else as fingers scatter."""
    near = "hand_length" in geometry.measured or geometry.measured & set(FINGERS)
    return length_sd if near else max(length_sd, FROM_PALM_SD)
