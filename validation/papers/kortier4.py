"""The artificial finger of Kortier's thesis, chapter 4: lengths, sensors' places and biases from 40 s of movement, nothing known before."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from handscope.app.report.units import DEG
from handscope.estimators.hand.anatomy import SEGMENT, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import (
    normal_equations,
    residuals,
    sample_preparation,
    segments,
    solver,
)
from handscope.estimators.self_calibration.problem import (
    Noise,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
    parameter_columns,
    with_noise,
)
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.uncertainty import posterior
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.artificial_finger import DISTANCES, HINGES, SEGMENTS
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread

DURATION, TRIALS = 40.0, 15
HINGED = build_chain(SEGMENTS, hinges=("index_mcp", "index_pip", "index_dip"))
WHITE = replace(
    IDEAL,
    gyr_noise=SensorErrors().gyr_noise,
    acc_noise=SensorErrors().acc_noise,
    gyr_bias=0.5,
    acc_bias=0.05,
)
CONDITIONS = {
    "white noise": WHITE,
    "skin motion": replace(
        WHITE, skin_angle=2.0, skin_shift=1.0, misalignment=7.5, misalignment_width=2.5
    ),
    "all errors": SensorErrors(),
}
PLACES = ("hand", "proximal", "middle", "distal")
CLOSE = 0.2  # %, within which lengths are to be found in white noise
MM = 1e3  # in a m
HINGE_AXIS = np.array([0.0, 0.0, 1.0])  # of every segment: docs/conventions.md


@dataclass(frozen=True)
class Trial:
    """One run: condition and seed."""

    condition: str  # of CONDITIONS
    seed: int


@dataclass(frozen=True)
class Found:
    """One trial."""

    converged: bool
    percent: dict[str, float]  # errors of distances and lengths
    sds: dict[str, float]  # errors of lengths in the standard deviations that were given with them
    # %, the least standard deviation of a length; nothing but white noise: empty elsewhere
    bound: dict[str, float]
    gyr_bias: float  # % of all axes, RMS error of RMS bias
    acc_bias: float  # % the same of the phalanges' accelerometers, against the board's along the hinges' axes
    mounting_error: float  # deg, of proximal and middle sensor, the larger
    tip: float  # mm, RMS error of the distance from the board's to the last sensor
    seconds: float  # of the processor


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [
        Trial(condition, seed)
        for condition in CONDITIONS
        for seed in range(min(wanted.seeds, TRIALS))
    ]


def measure(trial: Trial) -> Found:
    """One recording, calibrated from a cold start."""
    made = artificial_finger.record_trial(
        np.random.default_rng([trial.seed, 4]), CONDITIONS[trial.condition], duration=DURATION
    )
    began = time.process_time()
    _, read = sample_preparation.prepare_readings(
        list(made.blocks()), HINGED.sensors, 0.0, DURATION
    )
    guess = self_calibration_initialisation.initial_unknowns(
        HINGED, Noise(), read, axis_in_sensors(HINGED, made.mounting, Z)
    )
    found = solver.solve_with_noise(
        build_problem(HINGED, Noise(), read, guess.q_GS[0], made.hand, made.mounting), guess
    )
    seconds = time.process_time() - began
    solved = segments.of_solution(found, made.hand, made.mounting)
    at = found.at
    distances = np.linalg.norm(np.concatenate([at.far[:1], at.near]), axis=1)
    percent = {
        f"distance, {p}": 100 * (d / true - 1) for p, d, true in zip(PLACES, distances, DISTANCES)
    }
    lengths = {s.removeprefix("index_"): solved.lengths[s] for s in SEGMENTS[1:3]}
    percent |= {f"length, {name}": 100 * (length / HINGES - 1) for name, length in lengths.items()}
    sds = {
        name: (length - HINGES) / solved.lengths_sd[f"index_{name}"]
        for name, length in lengths.items()
    }
    true_bias = made.sensors.bias[:, :3]
    bias = 100 * float(np.sqrt(np.mean((at.bias_gyr - true_bias) ** 2) / np.mean(true_bias**2)))
    bound = _bound(found) if trial.condition == "white noise" else {}
    return Found(
        found.outcome == "converged",
        percent,
        sds,
        bound,
        bias,
        _acc_bias(made, found),
        _mounting_error(made, solved),
        _tip(made, found),
        seconds,
    )


def _acc_bias(made: Simulated, found: Solution) -> float:
    """Errors of the phalanges' accelerometers' biases, without what all have in common with the board's along the hinges' axes, %."""
    true = made.sensors.bias[:, 3:6]
    off = quat.rotate(made.sensors.q_BS, found.at.bias_acc - true)
    return 100 * float(np.sqrt(np.mean((off[1:] - off[:1] * HINGE_AXIS) ** 2) / np.mean(true**2)))


def _bound(found: Solution) -> dict[str, float]:
    """Cramer's and Rao's bound of both lengths, %: noise as simulated, hinges as good as a printed finger's, neither skin, scale errors nor lag among the unknowns.

    Asked where the solver ended, a few tenths of a per cent from the truth: that changes the bound by as little.
    """
    half_band = np.sqrt(0.5 / found.problem.dt)
    noise = replace(
        found.problem.noise,
        gyr=float(np.radians(WHITE.gyr_noise) * half_band),
        acc=WHITE.acc_noise * GRAVITY * half_band,
        hinge=posterior.LEAST_HINGE,
    )
    problem, c = with_noise(found.problem, noise), parameter_columns(found.problem.chain)
    normal = solver.build_normal_equations(problem, found.at)[0]
    kept = np.concatenate(
        [np.arange(c.scale_gyr.start), np.arange(c.axis_far.start, c.skin_turn.start)]
    )
    _, _, information = normal_equations.eliminate_trajectory(
        replace(normal, B=normal.B[:, :, kept], C=normal.C[np.ix_(kept, kept)], c=normal.c[kept])
    )
    least = normal_equations.invert(information)
    solved = residuals.length_priors(
        replace(problem, length=np.full(len(SEGMENTS), HINGES)), found.at
    )
    slopes = {SEGMENTS[t.sensor].removeprefix("index_"): t.by_parameters[0, kept] for t in solved}
    return {
        name: float(100 / HINGES * np.sqrt(slope @ least @ slope)) for name, slope in slopes.items()
    }


def _mounting_error(made: Simulated, solved: Segments) -> float:
    """Error of the sensors whose whole orientation movement tells, deg; truth of the straight finger."""
    off = [
        quat.angle(quat.relative(made.sensors.q_BS[k], solved.q_BS[SEGMENTS[k]])) for k in (1, 2)
    ]
    return float(DEG * max(off))


def _tip(made: Simulated, found: Solution) -> float:
    """The distance between the first and the last sensor, at every sample, against the truth; mm RMS."""
    at, links = found.at, found.problem.chain
    path = np.zeros((len(at.q_GS), 3))
    for k, (i, j) in enumerate(zip(links.parents, links.children)):
        path += quat.rotate(at.q_GS[:, i], at.far[k]) - quat.rotate(at.q_GS[:, j], at.near[k])
    ours = np.linalg.norm(path, axis=1)
    return float(MM * np.sqrt(np.mean((ours - _true_distance(made)) ** 2)))


def _true_distance(made: Simulated) -> Array:
    """From the first to the last sensor (n,), straight places on the true segments, m: a slide of the skin is an error."""
    q = [made.truth.q_GS[:, SEGMENT[s]] for s in SEGMENTS]
    bone = side_sign(made.hand) * np.array([0.0, HINGES, 0.0])
    geometry = artificial_finger.printed_geometry(made.hand)
    knuckle = np.array(geometry.joint_positions["index_mcp"]) - np.array(
        geometry.joint_positions["middle_mcp"]
    )
    p = made.sensors.p_BS
    path = (
        quat.rotate(q[0], knuckle - p[0])
        + quat.rotate(q[1], bone)
        + quat.rotate(q[2], bone)
        + quat.rotate(q[3], bone + p[3])
    )
    return np.asarray(np.linalg.norm(path, axis=1))


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Found]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    by = {c: [f for trial, f in results if trial.condition == c] for c in CONDITIONS}
    names = tuple(next(iter(by.values()))[0].percent)
    errors = tuple(
        Row(
            name,
            {c: spread(f.percent[name] for f in by[c]) for c in by},
            dict.fromkeys(by, published.KORTIER_FINGER[name][0]),
            dict.fromkeys(by, published.KORTIER_FINGER[name][1]),
        )
        for name in names
    )
    others = tuple(
        Row(
            label,
            {c: spread(getattr(f, key) for f in by[c]) for c in by},
            dict.fromkeys(by, theirs) if theirs else {},
        )
        for label, key, theirs in (
            (
                "gyroscopes' biases, RMS error, %",
                "gyr_bias",
                float(np.hypot(*published.KORTIER_FINGER["gyr bias"])),
            ),
            ("accelerometers' biases against the board's, RMS error, %", "acc_bias", 0.0),
            ("sensors' orientation, proximal and middle, deg", "mounting_error", 0.0),
            ("distance from the board's to the last sensor, RMS error, mm", "tip", 0.0),
            ("processor's time, s", "seconds", 0.0),
        )
    )
    tables = (
        Table(
            "Distances of sensors to their hinges and lengths of phalanges: error, %; the thesis' mean ± standard deviation",
            tuple(CONDITIONS),
            errors,
            "",
            "figure",
            2,
            "trials",
        ),
        Table("What else was found", tuple(CONDITIONS), others, "", "figure", 2, "trials"),
    )
    white, skin = by["white noise"], by["skin motion"]
    worst = max(abs(f.percent[n]) for f in white for n in names if n.startswith("length"))
    means = max(abs(float(np.mean([f.percent[n] for f in skin]))) for n in names)
    sds = max(
        float(np.std([f.percent[n] for f in skin], ddof=1)) if len(skin) > 1 else 0.0 for n in names
    )
    target = "target of self-calibration"
    verdicts = (
        Verdict("white noise: largest error of a length", worst, CLOSE, "%", target),
        Verdict("skin motion: largest mean error of a distance or length", means, 2.0, "%", target),
        Verdict("skin motion: largest standard deviation of one", sds, 4.0, "%", target),
        Verdict(
            "skin motion: largest error of a sensor's orientation",
            max(f.mounting_error for f in skin),
            2.0,
            "deg",
            target,
        ),
        Verdict(
            "skin motion: largest RMS error of the gyroscopes' biases",
            max(f.gyr_bias for f in skin),
            10.0,
            "%",
            target,
        ),
        Verdict(
            "skin motion: largest RMS error of the accelerometers' biases",
            max(f.acc_bias for f in skin),
            10.0,
            "%",
            target,
        ),
        Verdict(
            "skin motion: distance to the last sensor",
            max(f.tip for f in skin),
            2.0,
            "mm RMS",
            target,
        ),
        Verdict("processor's time for 40 s", max(f.seconds for f in skin), 20.0, "s", target),
    )
    remarks = (
        *(
            f"{c}: {sum(f.converged for f in by[c])} of {len(by[c])} trials converged from a cold start."
            for c in by
        ),
        *(
            f"{c}: errors of lengths are {np.sqrt(np.mean([v**2 for f in by[c] for v in f.sds.values()])):.1f} of their standard deviations (RMS; 1 = honest)."
            for c in by
        ),
        "Of the accelerometers' biases along the hinges' axes, which are parallel here, no movement tells what all four have in common (the thesis' are against the hand's sensor, too): it is left out.",
        *_against_the_bound(white),
    )
    return Finding(
        "kortier4",
        "Self-calibration of the artificial finger (Kortier, thesis ch. 4)",
        _setting(),
        tables,
        verdicts,
        remarks,
    )


def _against_the_bound(white: Sequence[Found]) -> Sequence[str]:
    """What of white noise's target any estimator could reach."""
    bounds = {name: np.array([f.bound[name] for f in white]) for name in white[0].bound}
    within = {name: 2 * ndtr(CLOSE / bound) - 1 for name, bound in bounds.items()}
    remarks = [
        f"white noise: the Cramér-Rao bound of the length of the {name} phalanx is {np.sqrt(np.mean(bound**2)):.2f} % (RMS over the trials), our error"
        f" {np.sqrt(np.mean([f.percent[f'length, {name}'] ** 2 for f in white])):.2f} %; an unbiased estimator that attains it is within {CLOSE:g} % in"
        f" {100 * within[name].mean():.0f} % of trials, ours was in {100 * np.mean([abs(f.percent[f'length, {name}']) < CLOSE for f in white]):.0f} %."
        for name, bound in bounds.items()
    ]
    every = 100 * float(np.prod([share.prod() for share in within.values()]))
    return [
        *remarks,
        f"white noise: such an estimator would keep all lengths of these {len(white)} trials within {CLOSE:g} % with a probability of about {every:.0f} %.",
    ]


def _setting() -> tuple[str, ...]:
    return (
        "Beside ours: 15 trials with a printed finger, Kortier's thesis, ch. 4. Distances there are uncertain by what a ruler tells. Its gyroscopes' biases: -2.1 ± 22.4 %, 22.5 % RMS. Its distance from the hand's"
        ' to the last sensor has no figure of error ("within millimeter level").',
        "Simulated: estimators/simulation/artificial_finger.py; hinges 30 mm apart, sensors at 75, 18, 19 and 24 mm, 40 s at 100 Hz. White noise: that of an MPU-9250 and constant"
        " biases of 0.5 deg/s and 0.05 m/s^2; skin motion: with it 2 deg and up to 1 mm for 90 deg of flexion, sensors 5 to 10 deg misaligned; all errors: as in the other experiments.",
    )
