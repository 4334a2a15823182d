"""map-live beside ekf and m2 on the same recordings: python docs/decisions/0007-map-live.py MOVEMENT[,MOVEMENT] seed ... [map] [KEY=VALUE ...]

Angles (RMS, deg), tips (RMS, mm), the angles' normalised error squared, processor's time for a second, how far behind the newest sample (mean, at
most, ms); phalanges between two joints (RMS error, %) as told and as map-live has them at the end; with `map` what that makes of the whole recording.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handscope.app.commands.words import say
from handscope.app.options import parse, with_options
from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import Block
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import ALL_METHODS
from handscope.estimators.pipeline.process import process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation.experiments import EXPERIMENTS
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import Simulated
from handscope.validation.benchmarks.map_live import errors
from handscope.validation.reproduce.experiments import Trial, performed

BESIDE = ("m2", "ekf", "map-live")
SINGLE = 500  # samples that come one by one


def compared(trial: Trial, options: Sequence[str], with_map: bool) -> str:
    made, said, last = performed(trial), [], None
    for name in BESIDE:
        figures, last = _stepped(made, name, options)
        said.append(f"{name} {figures}")
    assert last is not None
    found = {s: v for finger in last.fingers if finger.lengths for s, v in finger.lengths.items()}
    true = _true(trial)
    said.append(
        f"lengths told {_off(made.geometry.lengths, true, [*found]):.1f} %, map-live {_off(found, true, [*found]):.1f} %"
    )
    if with_map:
        of_map = process(ALL_METHODS["map"], ALL_METHODS["map"].Params(), made)
        lengths = _off(of_map.calibrations[0].geometry.lengths, true, [*found])
        said.append(
            "map {:.2f} deg {:.1f} mm {:.2f}, lengths {:.1f} %".format(
                *errors(made, of_map.trajectory), lengths
            )
        )
    return f"{trial.experiment} {trial.seed}: " + "; ".join(said)


def _stepped(made: Simulated, name: str, options: Sequence[str]) -> tuple[str, Any]:
    """The figures of a method, and its last state."""
    method = ALL_METHODS[name]
    params = with_options(method.Params, parse([*options]) if name == "map-live" else {})
    calibration = calibrate(params, made)[0][0]
    samples = next(made.blocks()).between(calibration.t, np.inf)
    first, rest = (
        Block(samples.stream, samples.t[part], samples.values[part])
        for part in (slice(SINGLE), slice(SINGLE, None))
    )
    state, given, late = method.start(params, calibration, made.streams), [], []
    began = time.process_time()
    for block in (*first.parts(1), *rest.parts(2048)):
        state, piece = method.step(params, state, block)
        given.append(piece)
        late += [1e3 * float(block.t[0] - t) for t in piece.t] if len(block.t) == 1 else []
    _, piece = method.finish(params, state)
    spent = (time.process_time() - began) / (samples.t[-1] - samples.t[0])
    moved = trajectory.join([*given, piece], made.hand)
    return "{:.2f} deg {:.1f} mm {:.2f}, {:.3f} s, {:.0f} {:.0f} ms".format(
        *errors(made, moved), spent, np.mean(late), max(late)
    ), state


def _true(trial: Trial) -> HandGeometry:
    """The hand of the trial's person: experiments.recorded."""
    of_person = np.random.default_rng(
        [trial.seed, list(EXPERIMENTS).index(trial.experiment)]
    ).spawn(2)[1]
    return draw_person("left", of_person.spawn(5)[0]).true


def _off(found: Mapping[str, float], true: HandGeometry, which: Sequence[str]) -> float:
    return 100 * float(np.sqrt(np.mean([(found[s] / true.lengths[s] - 1) ** 2 for s in which])))


if __name__ == "__main__":
    movements, words = sys.argv[1].split(","), sys.argv[2:]
    for seed in (int(w) for w in words if w.isdecimal()):
        for movement in movements:
            say(compared(Trial(movement, seed), [w for w in words if "=" in w], "map" in words))
