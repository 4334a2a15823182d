"""Self-calibration (`map`) judged by a simulator that shares no line with it: lengths, seats, places, biases, angles and tips against the truth."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT
from handscope.estimators.methods import map as method
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import contacts
from handscope.validation.independent.simulator.free_movement import (
    CHAINS,
    DEG,
    Setup,
    Truth,
)
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread

MOST = 3  # people of a condition
HAND = "whole right hand"
PEOPLE_TOUCHING = 6
# m between what is said to touch, of whole left hands that hold contacts before they move
TOUCHING: Mapping[str, float | None] = {
    "slow left hand": None,
    "slow left hand, contacts held before": 0.0,
    "slow left hand, contacts that did not happen": 0.04,
}
MOVED = 25.0  # s, of them
DURATION = 20.0  # s, of one finger where a condition does not say else
CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "100 Hz": {},
    "40 s": {"duration": 40.0},
    "60 Hz": {"rate": 60.0},
    "200 Hz": {"rate": 200.0},
    "with a forearm's sensor": {"forearm": True},
    "thumb": {"fingers": ("thumb",)},
    "fast (2 Hz)": {"pace": 2.0},
    "slow (0.4 Hz)": {"pace": 0.4},
    "no skin": {"skin": 0.0},
    "twice the skin": {"skin": 2.0},
    "skin that follows the bending's square": {"law": "growing"},
    "skin that levels off": {"law": "levelling"},
    "skin that lags": {"law": "lagging"},
    "stamps scattered by 2 ms": {"scatter": 0.002},
    HAND: {"hand": "right", "fingers": FINGERS, "duration": 40.0},
    **{
        name: {"fingers": FINGERS, "forearm": True, "pace": 0.6, "missed": 2.5 * DEG}
        for name in TOUCHING
    },
}
PEOPLE = dict.fromkeys(CONDITIONS, MOST) | {HAND: 1} | dict.fromkeys(TOUCHING, PEOPLE_TOUCHING)
OTHER_LAW = ("skin that levels off", "skin that lags")  # what self-calibration does not assume
WHAT = {  # unit, and how many of them in one of SI
    "lengths": ("mm", 1e3),
    "seats told": ("deg", 1 / DEG),
    "seats by the mounting": ("deg", 1 / DEG),
    "places": ("mm", 1e3),
    "gyroscopes' biases": ("deg/s", 1 / DEG),
    "accelerometers' biases": ("m/s^2", 1.0),
    "angles": ("deg", 1 / DEG),
    "tips": ("mm", 1e3),
}


@dataclass(frozen=True)
class Trial:
    """One run: condition and seed."""

    condition: str  # of CONDITIONS
    seed: int


@dataclass(frozen=True)
class Found:
    """One recording; everything by what WHAT names, where it was told."""

    refused: str  # in words; empty where something was found
    error: Mapping[str, float]  # RMS, SI
    squared: Mapping[str, float]  # mean of the squares of errors in their standard deviations
    percent: float  # largest error of a length, %; 0 where none was estimated
    worst: float  # the same in standard deviations
    seconds: float  # of the processor


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    asked = wanted.experiments or tuple(CONDITIONS)
    return [
        Trial(c, seed)
        for c, most in PEOPLE.items()
        if c in asked
        for seed in range(min(wanted.seeds, most))
    ]


def measure(trial: Trial) -> Found:
    """One recording, written, read and calibrated as `handscope process --method map` does it."""
    setup = Setup(trial.seed, **{"duration": DURATION, **CONDITIONS[trial.condition]})
    since = 0.0  # s, from when angles and tips are judged
    if trial.condition in TOUCHING:
        separation = TOUCHING[trial.condition]
        kinds = () if separation is None else tuple(contacts.HOLDS)
        movement, held, since = contacts.with_contacts(setup, kinds, separation or 0.0)
        setup = replace(setup, duration=since + MOVED)
        recording, true = write_and_load(setup, movement, held)
    else:
        recording, true = write_and_load(setup)
    began = time.process_time()
    try:
        found = process(method, method.Params(), recording)
    except InputError as problem:
        return Found(str(problem), {}, {}, 0.0, 0.0, time.process_time() - began)
    seconds = time.process_time() - began
    pairs: dict[str, list[tuple[Array, Array]]] = {}
    for what, error, sd in (
        *_alignment_errors(found.calibrations[0], true),
        *_trajectory_errors(found.trajectory, true, since),
    ):
        pairs.setdefault(what, []).append((error, sd))
    joined = {
        what: [np.concatenate([np.ravel(part) for part in parts]) for parts in zip(*some)]
        for what, some in pairs.items()
    }
    lengths = found.calibrations[0]
    return Found(
        "",
        {what: _rms(error) for what, (error, _) in joined.items()},
        {what: _rms(error / sd) ** 2 for what, (error, sd) in joined.items()},
        max(
            (
                100 * abs(lengths.geometry.lengths[s] / true.body.lengths[s] - 1)
                for s in lengths.lengths_sd
            ),
            default=0.0,
        ),
        float(np.abs(np.divide(*joined["lengths"])).max()) if "lengths" in joined else 0.0,
        seconds,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _alignment_errors(calibration: Calibration, true: Truth) -> Iterator[tuple[str, Array, Array]]:
    """Errors and standard deviations of what the calibration tells."""
    body = true.body
    last = {links[-1] for links in CHAINS.values()} | {"hand", "forearm"}
    for s, sd in calibration.lengths_sd.items():
        yield (
            "lengths",
            np.array([calibration.geometry.lengths[s] - body.lengths[s]]),
            np.array([sd]),
        )
    for s, sds in calibration.q_BS_sd.items():
        off = Rotation.from_quat(calibration.q_BS[s], scalar_first=True) * body.mountings[s].inv()
        yield "seats by the mounting" if s in last else "seats told", off.as_rotvec(), sds
    for s, sds in calibration.p_BS_sd.items():
        yield "places", calibration.p_BS[s] - body.places[s], sds
    for s, sds in calibration.gyr_bias_sd.items():
        yield "gyroscopes' biases", calibration.gyr_bias[s] - true.sensors.gyr_bias[s], sds
    for s, sds in calibration.acc_bias_sd.items():
        yield "accelerometers' biases", calibration.acc_bias[s] - true.sensors.acc_bias[s], sds


def _trajectory_errors(
    found: Trajectory, true: Truth, since: float
) -> Iterator[tuple[str, Array, Array]]:
    """Errors and standard deviations of angles and tips, at the method's instants."""
    assert found.angles_sd is not None and found.tips_sd is not None
    rows = found.t >= since
    t = found.t[rows]
    for joint, angles in true.angles.items():
        for axis in np.flatnonzero(IS_DOF[JOINT[joint]]):
            right = np.interp(t, true.t, angles[:, axis])
            yield (
                "angles",
                found.angles[rows, JOINT[joint], axis] - right,
                found.angles_sd[rows, JOINT[joint], axis],
            )
    for finger, tip in true.tips.items():
        k = FINGERS.index(finger)
        right = np.stack([np.interp(t, true.t, x) for x in tip.T], axis=1)
        yield "tips", found.tips[rows, k] - right, found.tips_sd[rows, k]


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Found]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    by = {
        c: [f for trial, f in results if trial.condition == c]
        for c in dict.fromkeys(trial.condition for trial, _ in results)
    }
    errors = [
        Row(
            c,
            {
                f"{w}, {unit}": spread(factor * f.error[w] for f in fs if w in f.error)
                for w, (unit, factor) in WHAT.items()
                if _any(w, fs)
            },
        )
        for c, fs in by.items()
    ]
    squared = [
        Row(c, {w: spread(f.squared[w] for f in fs if w in f.squared) for w in WHAT if _any(w, fs)})
        for c, fs in by.items()
    ]
    others = [
        Row(
            c,
            {"lengths' largest error, %": spread(f.percent for f in fs)}
            | {"in standard deviations": spread(f.worst for f in fs)}
            | {"processor's time, s": spread(f.seconds for f in fs)},
        )
        for c, fs in by.items()
    ]
    tables = (
        Table(
            "Errors, RMS",
            tuple(f"{w}, {unit}" for w, (unit, _) in WHAT.items()),
            tuple(errors),
            head="condition",
            digits=3,
            over="people",
        ),
        Table(
            "Squares of errors in their standard deviations (1 = as sure as it says, less = too careful)",
            tuple(WHAT),
            tuple(squared),
            head="condition",
            over="people",
        ),
        Table(
            "Lengths beside a joint, and what it takes",
            ("lengths' largest error, %", "in standard deviations", "processor's time, s"),
            tuple(others),
            head="condition",
            digits=1,
            over="people",
        ),
    )
    verdicts = tuple(
        verdict
        for kind in (False, True)
        for verdict in _verdicts(
            [f for c, fs in by.items() for f in fs if (c in OTHER_LAW) == kind], kind
        )
    )
    refused = [
        f"{t.condition}, person {t.seed}: refused ({f.refused})." for t, f in results if f.refused
    ]
    return Finding(
        "independent",
        "Self-calibration judged by a simulator of its own",
        _setting(),
        tables,
        verdicts,
        tuple(refused),
        simulated=False,
    )


def _verdicts(found: Sequence[Found], other_law: bool) -> Iterator[Verdict]:
    """Lengths against what is to be reached; nothing where nothing was measured."""
    skin = "skin of another law than is assumed" if other_law else "skin as assumed"
    if found:
        yield Verdict(
            f"{skin}: largest error of a length",
            max(f.percent for f in found),
            2.0,
            "%",
            "target of self-calibration",
        )
        yield Verdict(
            f"{skin}: the same in its standard deviation",
            max(f.worst for f in found),
            3.0,
            "of them",
            "ours: where they are honest",
        )


def _any(what: str, found: Sequence[Found]) -> bool:
    return any(what in f.error for f in found)


def _setting() -> tuple[str, ...]:
    return (
        "Simulated by validation/independent/simulator/free_movement.py, which shares no line with estimators/: closed formulas for the movement, rates and accelerations by differences. Every person has"
        f" lengths, places and movement of his own, the same in every row; index finger and hand for {DURATION:g} s at 100 Hz where the row does not say else. Sensors sit misaligned by 5 deg about each axis,"
        " skin turns them by 2 deg and slides them by 1 mm in 90 deg of their joint, the hand's sensor with the fingers; biases 0.8 deg/s and 0.12 m/s^2, noise 0.007 deg/s and 150 ug a square"
        " root of a Hz, scales and axes off by 0.3 %. The palm's length and where fingers hang on it are told exactly, no finger's length is.",
        f"Slow left hands have a forearm's sensor, lie flat at first, a pose of which every freedom is missed by a normal error of 2.5 deg, and move for {MOVED:g} s at up to 0.6 Hz; angles and tips are judged then. Before it fingertips are held on the thumb, a table and the"
        " palm, pads 3 mm beside each other (each axis), creases 4 mm beside where they are believed, a table tilted by 0.8 deg; where contacts did not happen, 4 cm from there, or up to that above the table.",
        "`Seats told` are the sensors' that movement tells wholly; those of the hand, the forearm and the last phalanges lean on the nominal mounting, and on the pose where there is one. Skin that follows the bending's square:"
        " 0.6 of the angle and 0.6 of its square over 90 deg; that levels off: the angle's sine; that lags: 9 deg of bending behind, either way. Self-calibration takes skin to follow in proportion, and the square by as much as it finds.",
    )
