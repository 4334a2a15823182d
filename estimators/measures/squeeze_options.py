"""Options of the squeeze measure and of the identification of springs."""

from dataclasses import dataclass

from handscope.estimators.data.options import option
from handscope.estimators.force.contact import ContactParams


@dataclass(frozen=True, kw_only=True)
class Params(ContactParams):
    """Options of the measure."""

    shortest: float = option(1.0, "s", "a shorter touch is none", "ours", least=0.0)
    margin: float = option(
        0.3, "s", "at both ends of a grasp that tell nothing: fingers settle", "ours", least=0.0
    )
    prominence: float = option(
        0.25,
        "1",
        "share of the force's range by which a squeeze stands out",
        "ours: as of tapping",
        least=0.05,
        most=0.9,
    )
    least_force: float = option(
        1.0,
        "N",
        "range of the force below which nothing was squeezed",
        "ours: ten times its error",
        least=0.1,
    )
    least_depth: float = option(
        3e-3,
        "m",
        "range of the distance below which the object counts as rigid",
        "ours: what the fingertips' places wander by",
        least=1e-4,
    )
    memory: float = option(
        3.0,
        "s",
        "time after which a sample counts for 1/e in the running estimate",
        "ours: two squeezes",
        least=0.1,
    )
    gain_sd: float = option(
        0.055,
        "1",
        "error of a change of the fingertips' distance",
        "docs/validation/kortier6.md: RMS over simulated people",
        least=0.0,
    )
    scale_sd: float = option(
        0.02,
        "1",
        "error of the forces' scale, where the sensors were not calibrated",
        "BioMed Eng OnLine 11:90, Table 4",
        least=0.0,
    )
    further: float = option(
        0.1,
        "1",
        "error of that change where a joint bends further than it may in the model",
        "ours: 8 % RMS of ten people whose thumb's last joint hyperextends by 40 deg",
        least=0.0,
    )
    timing: float = option(
        0.01,
        "s",
        "by how much forces and places may be shifted against each other",
        "ours: a sample at 100 Hz",
        least=0.0,
    )
    bent: float = option(
        0.6,
        "1",
        "share by which the stiffness changes over the squeezes' range, beyond which force and distance are not taken for those of a linear spring",
        "ours: 0.5 of one in eight simulated people who squeeze a linear spring, by how their hand differs from the model",
        least=0.05,
    )
    lowpass: float = option(
        6.0,
        "Hz",
        "what is faster is taken for noise",
        "ours: the bandwidth of a sensor at 12 Hz",
        least=1.0,
    )
