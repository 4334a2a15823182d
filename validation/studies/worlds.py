"""Worlds in which standard deviations are judged: whose errors, how large, of what kind.

A world is the first of them, `as believed`, with something changed. A world is `covered` if the model of `ekf` says so: a pose missed by 1.5 to 2.5 deg (option `pose_sd`),
other sizes between half and twice its options, whatever their distribution, joints that give as measured ones. Other laws of the skin, seats that move and other poses are none of the model's.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from handscope.estimators.simulation import joint_compliance
from handscope.estimators.simulation.distributions import DISTRIBUTIONS
from handscope.estimators.simulation.experiments import PersonErrors
from handscope.estimators.simulation.person import Anatomy
from handscope.estimators.simulation.sensors import SensorErrors

POSE = 2.0  # deg, standard deviation: between the sizes that `missed-pose` measures
SLIP = 3.0  # deg


@dataclass(frozen=True)
class World:
    """What errs, and whether the model claims to cover it."""

    person: PersonErrors = field(
        default_factory=lambda: PersonErrors(pose_deg=POSE, distribution="normal")
    )
    errors: SensorErrors = field(default_factory=SensorErrors)
    covered: bool = True


SOURCES: Mapping[str, tuple[str, ...]] = {  # error sizes that belong together
    "misalignment": ("misalignment", "misalignment_width"),
    "skin": ("skin_angle", "skin_shift"),
    "gyroscope noise": ("gyr_noise",),
    "gyroscope bias and its walk": ("gyr_bias", "gyr_bias_walk"),
    "gyroscope scale": ("gyr_scale", "cross_axis"),
    "accelerometer": ("acc_noise", "acc_bias", "acc_scale"),
}
TIMES = (0.5, 2.0)
POSES = (0.0, 1.5, 2.5, 5.0)  # deg, beside POSE and its multiples
CLAIMED_POSES = (1.5, 2.5)  # deg, from and to: ekf's option `pose_sd`


def is_claimed(pose_deg: float) -> bool:
    """Whether the model claims to cover a pose that is missed by that standard deviation."""
    return CLAIMED_POSES[0] <= pose_deg <= CLAIMED_POSES[1]


def _person(**changed: Any) -> PersonErrors:
    return replace(World().person, **changed)


def _errors(**changed: Any) -> SensorErrors:
    return replace(SensorErrors(), **changed)


def _multiply(source: str, times: float) -> World:
    """A source of errors, or "all sources", times a number."""
    world = World()
    sizes = [s for name, own in SOURCES.items() if source in (name, "all sources") for s in own]
    world = replace(
        world,
        errors=replace(world.errors, **{s: times * getattr(world.errors, s) for s in sizes}),
    )
    if source in ("pose", "all sources"):
        world = replace(
            world,
            person=replace(world.person, pose_deg=times * POSE),
            covered=is_claimed(times * POSE),
        )
    if source in ("lengths", "all sources"):
        usual = Anatomy()
        wider = {f.name: times * getattr(usual, f.name) for f in fields(usual)}
        wider |= {"hand_length": usual.hand_length, "finger_length": usual.finger_length}
        world = replace(world, person=replace(world.person, anatomy=Anatomy(**wider)))
    return world


WORLDS: Mapping[str, World] = {
    "as believed": World(),
    **{
        f"{source} x {times:g}": _multiply(source, times)
        for source in ("pose", *SOURCES, "lengths", "all sources")
        for times in TIMES
    },
    **{
        f"pose missed by {pose:g} deg": World(_person(pose_deg=pose), covered=is_claimed(pose))
        for pose in POSES
    },
    **{
        f"pose {kind}": World(_person(distribution=kind))
        for kind in DISTRIBUTIONS
        if kind != World().person.distribution
    },
    **{
        f"sensors' errors {kind}": World(errors=_errors(distribution=kind))
        for kind in DISTRIBUTIONS
    },
    "joints give as measured": World(_person(give_deg=joint_compliance.AS_MEASURED)),
    "joints give twice that": World(
        _person(give_deg=2 * joint_compliance.AS_MEASURED), covered=False
    ),
    **{
        f"skin {law}": World(errors=_errors(skin_law=law), covered=False)
        for law in ("quadratic", "delayed", "sticking")
    },
    "one sensor slips": World(errors=_errors(slip=SLIP, slipping=1), covered=False),
    "every sensor slips": World(errors=_errors(slip=SLIP), covered=False),
}
