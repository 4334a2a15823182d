"""The figures that the papers report, measured again: `handscope reproduce`. A new reproduction is a file here and a line in the table.

A reproduction is a module: `trials(wanted)` lists what is to be run (small values that travel to another process), `measure(trial)` runs one,
`finding(wanted, results)` makes of all of them what is printed, drawn and written.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from handscope.validation.reproduce.finding import Finding

REPRODUCTIONS = {
    "table6": "fingertip against the truth, one finger moving, homogeneous field (Salchow-Hoemmen 2019, Table 6)",
    "table7": "known distance between fingertips, whole hand moving near steel (Salchow-Hoemmen 2019, Table 7)",
    "mechanical-finger": "one joint after the other to 90 deg and back (Valtin 2017, Fig. 4)",
    "kortier2": "fingertip, pinch, fastest movement and repeatability (Kortier's thesis, ch. 2)",
    "kortier3": "fifteen finger tasks after functional calibration (Kortier's thesis, ch. 3)",
    "kortier4": "lengths, places of sensors and biases of an artificial finger from free movement (Kortier's thesis, ch. 4)",
    "observability": "which movements of a finger tell its lengths, its sensors' places and their biases",
    "independent": "self-calibration judged by a simulator that shares nothing with it: one finger in many ways, a whole hand",
    "independent-pose": "what an inexact pose costs, by a simulator that shares nothing with the program",
    "kortier5": "the hand followed by a magnet (Kortier's thesis, ch. 5)",
    "independent-reach": "the hand followed by a magnet in a world that is not ours: another simulator, through files",
    "kortier6": "mass and stiffness of what the fingers hold (Kortier's thesis, ch. 6)",
    "independent-grasp": "what the fingers hold, by a simulator that shares nothing with the program",
    "independent-array": "a magnet before a board of magnetometers, by a simulator that shares nothing with the program",
    "budget": "what each source of error costs: switched off in turn, and alone",
    "pushed": "how far what remains of Table 6 can be pushed: by a common inclination, by a functional calibration",
    "drift": "10 and 60 minutes without magnetometers",
    "honesty": "whether standard deviations of ekf and m2 are as large as the errors, in many worlds",
    "missed-pose": "what a pose costs that is taken less exactly, and what measuring a part of it gives back",
    "photograph": "lengths and angles of a hand from a photograph of it on the printed sheet, rendered",
    "broad": "the fusion on real trials (Laidig et al. 2021)",
    "fault-table": "how large a fault of a sensor must be to be found, and how often intact recordings are doubted",
    "crosschecks": "the same for faults that only sensors compared with each other show",
    "false-alarms": "what the checks say of recordings that are right, of 37 kinds",
    "silent-faults": "everyday mistakes that cost much and go without a word, by a simulator that shares nothing with the program",
}


MODULES = {  # of handscope.validation
    "table6": "papers.table6",
    "table7": "papers.table7",
    "mechanical-finger": "papers.mechanical_finger",
    "kortier2": "papers.kortier2",
    "kortier3": "papers.kortier3",
    "kortier4": "papers.kortier4",
    "observability": "studies.observability",
    "independent": "independent.self_calibration",
    "independent-pose": "independent.missed_pose",
    "kortier5": "papers.kortier5",
    "independent-reach": "independent.reach",
    "kortier6": "papers.kortier6",
    "independent-grasp": "independent.grasp",
    "independent-array": "independent.magnetometer_array",
    "budget": "studies.budget",
    "pushed": "papers.pushed",
    "drift": "studies.drift",
    "honesty": "studies.honesty",
    "missed-pose": "studies.missed_pose",
    "photograph": "studies.photograph",
    "broad": "studies.broad",
    "fault-table": "studies.fault_table",
    "crosschecks": "studies.crosschecks",
    "false-alarms": "studies.false_alarms",
    "silent-faults": "studies.silent_faults",
}


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    seeds: int = 20
    experiments: tuple[str, ...] = ()  # of table6, table7 and independent only these; empty: all
    broad_data: Path = Path("data/broad")
    minutes: int = 60  # of drift


class Reproduction(Protocol):
    """What the modules have in common."""

    def trials(self, wanted: Wanted) -> Sequence[Any]: ...

    def measure(self, trial: Any) -> Any: ...

    def finding(self, wanted: Wanted, results: Sequence[tuple[Any, Any]]) -> Finding: ...


def reproduction(name: str) -> Reproduction:
    """The module of that name; imported when it is asked for."""
    found: Reproduction = import_module(f"handscope.validation.{MODULES[name]}")
    return found


def default_broad_data() -> Path:
    """Where the BROAD trials are looked for when nobody says: HANDSCOPE_BROAD, or a folder beside."""
    return Path(os.environ.get("HANDSCOPE_BROAD") or "data/broad")
