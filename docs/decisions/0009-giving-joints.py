"""What `ekf`'s standard deviations are worth where joints give about axes that are none of their freedoms: by the belief alone, and learnt beside it.

Run     python docs/decisions/0009-giving-joints.py, from the repository; a minute
Out     for hinges that are exact, that give as their flexion is (estimators/simulation/joint_compliance.py) and that give as it comes (sines of 2 to 6 s): normalised
        errors squared of angles and tips, RMS of the angles, for `ekf` as it is and where nothing is learnt; `free` movement of four people
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.finger_ekf import filter as finger_ekf_filter
from handscope.estimators.hand.anatomy import IS_DOF, JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import ekf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import (
    PersonErrors,
    judged_samples,
    record_experiment,
)
from handscope.estimators.simulation.motion import Motion
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors

PEOPLE = 4
SURE = 1e9  # samples that a belief counts as which nothing changes
GIVES = ~IS_DOF * np.array([[joint.name != "wrist"] for joint in JOINTS])
EVENLY = np.sqrt(2 / 5)  # five sines together have the standard deviation 1


@dataclass(frozen=True)
class Wandering(Motion):
    """A motion whose joints give by `size` rad (root mean square) as it comes; it begins and ends within a second, smoothly."""

    size: float
    w: Array  # (joints, 3, 5) rad/s
    phase: Array  # (joints, 3, 5) rad

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        u = np.clip(np.minimum(t, self.duration - t), 0.0, 1.0)
        sign = np.where((u > 0) & (u < 1), np.sign(self.duration / 2 - t), 0.0)
        share, rate, bend = (
            u**3 * (10 - 15 * u + 6 * u**2),
            30 * u**2 * (1 - u) ** 2 * sign,
            60 * u * (1 - u) * (1 - 2 * u) * sign**2,
        )
        s, ds, dds = (v[:, None, None] for v in (share, rate, bend))
        turned = self.w * t[:, None, None, None] + self.phase
        y, dy, ddy = (
            EVENLY * v.sum(axis=-1)
            for v in (np.sin(turned), self.w * np.cos(turned), -(self.w**2) * np.sin(turned))
        )
        given = s * y, ds * y + s * dy, dds * y + 2 * ds * dy + s * ddy
        x, dx, ddx = super().at(t)
        for whole, added in zip((x, dx, ddx), given):
            whole[:, 6:] += (self.size * GIVES * added).reshape(len(t), -1)
        return x, dx, ddx


def made(seed: int, size_deg: float, follows: bool) -> Simulated:
    rng, experiment = np.random.default_rng([9, seed]), experiments.EXPERIMENTS["free"]
    w, phase = (
        2 * np.pi / rng.uniform(2, 6, (*IS_DOF.shape, 5)),
        rng.uniform(0, 2 * np.pi, (*IS_DOF.shape, 5)),
    )

    def perform(geometry: HandGeometry, generator: np.random.Generator) -> tuple[Performance, ...]:
        pose, *rest = experiment.perform(geometry, generator)
        return (
            pose,
            *(
                replace(p, motion=Wandering(p.motion.spline, np.radians(size_deg), w, phase))
                for p in rest
            ),
        )

    wandering = experiment if follows else replace(experiment, perform=perform)
    give_deg = size_deg if follows else 0.0
    return record_experiment(
        wandering,
        np.random.default_rng([seed, 3]),
        SensorErrors(),
        None,
        "left",
        person=PersonErrors(pose_deg=2.5, give_deg=give_deg),
    )


def judge(recording: Simulated, learning: bool) -> tuple[float, float, float]:
    """Normalised errors squared of angles and tips, RMS of the angles in deg."""
    start = finger_ekf_filter.start

    def sure(*given, **named):  # type: ignore[no-untyped-def]
        state = start(*given, **named)
        belief = np.radians(ekf.Params().dimension_noise) ** 2
        return replace(
            state, give=np.broadcast_to(SURE * np.array([belief, 1.0]), state.give.shape).copy()
        )

    finger_ekf_filter.start = start if learning else sure
    moved = process(ekf, ekf.Params(), recording).trajectory
    finger_ekf_filter.start = start
    assert moved.angles_sd is not None and moved.tips_sd is not None
    where = judged_samples(recording)
    angles, tips = (
        (getattr(moved, what) - getattr(recording.truth, what))[where]
        for what in ("angles", "tips")
    )
    free = angles[:, IS_DOF]
    squares = (
        np.nanmean((free / moved.angles_sd[where][:, IS_DOF]) ** 2),
        np.nanmean((tips / moved.tips_sd[where]) ** 2),
    )
    return float(squares[0]), float(squares[1]), float(np.degrees(np.sqrt((free**2).mean())))


def main() -> None:
    for follows, sizes in ((True, (0.0, 1.0, 2.0)), (False, (1.0, 3.0))):
        for size in sizes:
            recordings = [made(seed, size, follows) for seed in range(PEOPLE)]
            for learning in (False, True):
                angles, tips, rms = np.mean([judge(r, learning) for r in recordings], axis=0)
                kind = f"{size:g} deg, {'as it flexes' if follows else 'as it comes'}, {'learnt' if learning else 'believed'}"
                print(f"{kind:36s} angles {angles:.2f}, tips {tips:.2f}, {rms:.2f} deg", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
