"""Which movements tell what: the artificial finger and a human one moved in nine ways, and how sure self-calibration is afterwards.

The thesis asks for arbitrary movements (4.5.2) and does not say which are needed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from handscope.app.report.units import DEG
from handscope.estimators.hand.anatomy import side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import sample_preparation, segments, solver
from handscope.estimators.self_calibration.problem import (
    Chain,
    Noise,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
    parameter_columns,
)
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.artificial_finger import (
    RESTING,
    SEGMENTS,
    smooth_random_course,
)
from handscope.estimators.simulation.motion import COORDINATES, SIZE, Motion, interpolate_postures
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import InertialGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import SensorSet
from handscope.validation.papers.kortier4 import CONDITIONS, HINGED, MM
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.figures import Cells, cells
from handscope.validation.reproduce.finding import Finding, Row, Table, spread

DURATION, STEP, MOST = 20.0, 0.12, 5  # s; s between the knots of a movement; trials of one kind
JOINTS = ("index_mcp", "index_pip", "index_dip")
REACH = {"index_mcp": 75.0, "index_pip": 90.0, "index_dip": 60.0}  # deg
ASIDE = 12.0  # deg, of the human MCP joint to either side
PLACE = tuple(f"wrist_{axis}" for axis in "xyz")
TURN = tuple(f"forearm_{angle}" for angle in ("flexion", "deviation", "pronation"))


@dataclass(frozen=True)
class Movement:
    """What moves, and how many times slower than a thread is pulled once a second."""

    joints: tuple[str, ...]
    turns: bool
    travels: bool
    slower: float = 1.0


MOVEMENTS: Mapping[str, Movement] = {
    "MCP alone, hand still": Movement(JOINTS[:1], False, False),
    "PIP alone, hand still": Movement(JOINTS[1:2], False, False),
    "all joints, hand still": Movement(JOINTS, False, False),
    "hand turns, finger stiff": Movement((), True, False),
    "PIP alone, hand turns": Movement(JOINTS[1:2], True, False),
    "all joints, hand turns": Movement(JOINTS, True, False),
    "all joints, hand travels": Movement(JOINTS, False, True),
    "all joints, turns and travels": Movement(JOINTS, True, True),
    "the same, three times slower": Movement(JOINTS, True, True, 3.0),
}
FINGERS: Mapping[str, Chain] = {"artificial finger": HINGED, "human finger": build_chain(SEGMENTS)}
# z of a segment is its hinges' axis, y runs along its bone
UPWARD, ALONG = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
# what a movement may tell: unit, and the standard deviation that is good enough
GOOD: Mapping[str, tuple[str, float]] = {
    "length, proximal": ("mm", 0.6),
    "length, middle": ("mm", 0.6),
    "sensors to MCP": ("mm", 0.6),
    "sensors to PIP": ("mm", 0.6),
    "sensors to DIP": ("mm", 0.6),
    "axis of PIP": ("deg", 2.0),
    "axis of DIP": ("deg", 2.0),
    "gyroscopes' biases": ("deg/s", 0.05),
    "accelerometers' biases": ("m/s^2", 0.02),
}


@dataclass(frozen=True)
class Trial:
    """One run: finger, movement and seed."""

    finger: str  # of FINGERS
    movement: str  # of MOVEMENTS
    seed: int


@dataclass(frozen=True)
class Found:
    """By what GOOD names, in its unit."""

    converged: bool
    sd: Mapping[str, float]
    error: Mapping[str, float]


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial(*which) for which in product(FINGERS, MOVEMENTS, range(min(wanted.seeds, MOST)))]


def measure(trial: Trial) -> Found:
    """One recording, calibrated from a cold start."""
    links, rng = FINGERS[trial.finger], np.random.default_rng([trial.seed, 6])
    made, true = _record(trial, rng)
    _, read = sample_preparation.prepare_readings(list(made.blocks()), links.sensors, 0.0, DURATION)
    guess = self_calibration_initialisation.initial_unknowns(
        links, Noise(), read, axis_in_sensors(links, made.mounting, Z)
    )
    found = solver.solve_with_noise(
        build_problem(links, Noise(), read, guess.q_GS[0], made.hand, made.mounting), guess
    )
    estimates = list(_estimates_and_errors(found, made, true))
    sd = {name: _rms([s for n, s, _ in estimates if n == name]) for name in GOOD}
    error = {name: _rms([e for n, _, e in estimates if n == name]) for name in GOOD}
    return Found(found.outcome == "converged", sd, error)


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _record(trial: Trial, rng: np.random.Generator) -> tuple[Simulated, HandGeometry]:
    """The movement of the printed finger, or of somebody's index finger; its true geometry."""
    motion, errors = (
        make_motion(rng, MOVEMENTS[trial.movement], trial.finger == "human finger"),
        CONDITIONS["skin motion"],
    )
    if trial.finger == "human finger":
        person = draw_person("left", rng)
        return simulate_performances(
            [Performance(motion, ())],
            "left",
            person.true,
            rng,
            errors,
            glove=InertialGlove(segments=SEGMENTS),
            known=person.declared,
        ), person.true
    return artificial_finger.record_trial(
        rng, errors, motion=motion, duration=DURATION
    ), artificial_finger.printed_geometry("left")


def make_motion(rng: np.random.Generator, movement: Movement, sideways: bool) -> Motion:
    """Rest, the movement, rest; a joint that does not move is a little bent."""
    t = np.arange(0.0, DURATION + 1e-9, STEP)
    moving = np.clip(np.minimum(t - RESTING, DURATION - RESTING - t), 0.0, 1.0)
    x = np.zeros((len(t), SIZE))
    pulled = (
        2
        * np.pi
        * np.cumsum(STEP * (1.0 + 0.25 * smooth_random_course(rng, t, 2.0)))
        / movement.slower
    )
    for k, joint in enumerate(JOINTS):
        swing = 0.5 - 0.5 * np.cos(pulled - k) if joint in movement.joints else 0.3
        x[:, COORDINATES[f"{joint}_flexion"]] = moving * np.radians(REACH[joint]) * swing
    if sideways and "index_mcp" in movement.joints:
        x[:, COORDINATES["index_mcp_deviation"]] = moving * np.radians(ASIDE) * np.sin(0.7 * pulled)
    for wanted, names, reach, slowest in (
        (movement.travels, PLACE, 0.10, 0.9),
        (movement.turns, TURN, np.radians(40.0), 1.6),
    ):
        for name in names:
            x[:, COORDINATES[name]] = (
                wanted * moving * reach * smooth_random_course(rng, t, slowest * movement.slower)
            )
    return interpolate_postures(t, x)


def _estimates_and_errors(
    found: Solution, made: Simulated, true: HandGeometry
) -> Iterator[tuple[str, float, float]]:
    """Name in GOOD, standard deviation and error in its unit; a quantity that is estimated several times comes as often."""
    lengths = segments.of_solution(found, made.hand, made.mounting)
    for s in SEGMENTS[1:3]:
        yield (
            f"length, {s.removeprefix('index_')}",
            MM * lengths.lengths_sd[s],
            MM * (lengths.lengths[s] - true.lengths[s]),
        )
    at, c, worn, covariance = (
        found.at,
        parameter_columns(found.problem.chain),
        made.sensors,
        found.factor.covariance,
    )
    for k, joint in enumerate(JOINTS):
        for where, arm, right in (
            (c.far, at.far[k], _to_far(worn, true, k)),
            (c.near, at.near[k], _to_near(worn, true, k + 1)),
        ):
            rows = slice(where.start + 3 * k, where.start + 3 * k + 3)
            size = float(np.linalg.norm(arm))
            variance = arm @ covariance[rows, rows] @ arm / size**2
            yield (
                f"sensors to {joint.removeprefix('index_').upper()}",
                MM * float(np.sqrt(variance)),
                MM * (size - right),
            )
    variances = np.diag(covariance)
    for h, k in enumerate(found.problem.chain.hinges):
        for where, axis, s in (
            (c.axis_far, at.axis_far[h], k),
            (c.axis_near, at.axis_near[h], k + 1),
        ):
            off = np.arccos(
                np.clip(abs(axis @ quat.rotate(quat.conjugate(worn.q_BS[s]), UPWARD)), 0.0, 1.0)
            )
            sd = np.sqrt(variances[where].reshape(-1, 2)[h].sum())
            yield (
                f"axis of {JOINTS[k].removeprefix('index_').upper()}",
                DEG * float(sd),
                DEG * float(off),
            )
    for sd, off in zip(np.sqrt(variances[c.bias_gyr]), np.ravel(at.bias_gyr - worn.bias[:, :3])):
        yield "gyroscopes' biases", DEG * float(sd), DEG * float(off)
    for sd, off in zip(np.sqrt(variances[c.bias_acc]), np.ravel(at.bias_acc - worn.bias[:, 3:6])):
        yield "accelerometers' biases", float(sd), float(off)


def _to_far(worn: SensorSet, true: HandGeometry, s: int) -> float:
    """From a sensor to the joint behind its segment, m."""
    knuckle = np.array(true.joint_positions["index_mcp"]) - np.array(
        true.joint_positions["middle_mcp"]
    )
    return float(np.linalg.norm((knuckle if s == 0 else 0.0) - worn.p_BS[s]))


def _to_near(worn: SensorSet, true: HandGeometry, s: int) -> float:
    """From a sensor to the joint before its segment, m."""
    return float(
        np.linalg.norm(side_sign(true.hand) * true.lengths[SEGMENTS[s]] * ALONG + worn.p_BS[s])
    )


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Found]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    by = {
        (f, m): [r for trial, r in results if (trial.finger, trial.movement) == (f, m)]
        for f, m in product(FINGERS, MOVEMENTS)
    }
    tables = tuple(
        Table(
            f"{finger.capitalize()}, {what}",
            tuple(f"{name}, {unit}" for name, (unit, _) in GOOD.items()),
            tuple(
                Row(
                    m,
                    {
                        f"{name}, {unit}": spread(getattr(r, key)[name] for r in by[finger, m])
                        for name, (unit, _) in GOOD.items()
                    },
                )
                for m in MOVEMENTS
            ),
            head="movement",
            over="trials",
        )
        for finger in FINGERS
        for what, key in (
            ("standard deviations from the covariance", "sd"),
            ("errors found", "error"),
        )
    )
    drawn = {
        f: Cells(
            f.capitalize(),
            tuple(_with_convergence(m, by[f, m]) for m in MOVEMENTS),
            np.array([[np.mean([r.sd[n] for r in by[f, m]]) for n in GOOD] for m in MOVEMENTS]),
            np.array(
                [
                    [np.sqrt(np.mean([r.error[n] ** 2 for r in by[f, m]])) for n in GOOD]
                    for m in MOVEMENTS
                ]
            ),
        )
        for f in FINGERS
    }
    names = tuple(f"{name}\n{unit}".replace("' ", "'\n") for name, (unit, _) in GOOD.items())
    figures = {
        "reproduce-observability.svg": cells(
            tuple(drawn.values()), names, [good for _, good in GOOD.values()]
        )
    }
    return Finding(
        "observability",
        "Which movements tell what",
        _setting(),
        tables,
        (),
        tuple(_remarks(by)),
        figures,
    )


def _with_convergence(movement: str, results: Sequence[Found]) -> str:
    """With how often the solver came to an end, where that was not always."""
    ended = sum(r.converged for r in results)
    return (
        movement if ended == len(results) else f"{movement}\n(ended in {ended} of {len(results)})"
    )


def _remarks(by: Mapping[tuple[str, str], Sequence[Found]]) -> Iterator[str]:
    for finger in FINGERS:
        ended = [
            f"{m} ({sum(r.converged for r in by[finger, m])} of {len(by[finger, m])})"
            for m in MOVEMENTS
            if not all(r.converged for r in by[finger, m])
        ]
        yield f"{finger.capitalize()}: the calibration {'came to an end after every movement' if not ended else 'did not always come to an end: ' + ', '.join(ended)}."
        for m in MOVEMENTS:
            untold = [
                n
                for n, (_, good) in GOOD.items()
                if np.mean([r.sd[n] for r in by[finger, m]]) > good
            ]
            yield f"{finger.capitalize()}, {m}: {'everything is told' if not untold else 'not told well enough: ' + ', '.join(untold)}."


def _setting() -> tuple[str, ...]:
    return (
        f"Simulated: {DURATION:g} s, sensors and skin as in `skin motion` of `handscope reproduce kortier4`. The artificial finger has three hinges; the human finger is somebody's index finger, whose MCP joint also moves"
        f" {ASIDE:g} deg to either side. Joints that move bend by up to {', '.join(f'{a:g}' for a in REACH.values())} deg about once a second, the hand turns by up to 40 deg and travels by up to 10 cm about every axis.",
        "Told well enough is what is known within "
        + ", ".join(f"{good:g} {unit} ({name})" for name, (unit, good) in GOOD.items())
        + ". A standard deviation close to what was believed before (axes of joints: see `place`, `aside`, `gyr_bias`, `acc_bias` of `handscope process --help`) says that nothing was told.",
    )
