"""A session of a story as a recording: the virtual patient performs the tasks as well as the hand can, a glove with real sensors' errors records it."""

from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path

import numpy as np

from handscope.app.example_patients.stories import LONG_FINGERS, Ability
from handscope.app.version import software_version
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES
from handscope.estimators.simulation.movements import task_performance as perform
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import InertialGlove, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from handscope.estimators.simulation.transmission import LINKS
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.tables_io.writing import save_file

RATE = 50.0  # Hz
ANGLE_SD, RATE_SD = 2.0, 0.05  # deg and share by which a person does not repeat itself
DEVICE = "simulated glove"


def write(
    ability: Ability,
    tasks: tuple[str, ...],
    hand: Hand,
    seeds: tuple[int, int],  # of the person, of this session
    started: datetime,
    target: Path,
) -> None:
    """Write the session as Motion-BIDS."""
    person = draw_person(hand, np.random.default_rng(seeds[0]))
    of_day, of_sensors = np.random.default_rng(seeds).spawn(2)
    done = [PERFORMED[task](person.true, ability, of_day) for task in tasks]
    made = simulate_performances(
        (perform.initial_pose(person.true), *done),
        hand,
        person.true,
        of_sensors,
        PRESETS["MPU-9250"],
        glove=InertialGlove(rate=RATE, link=LINKS["wired"]),
        known=person.declared,
    )
    recording = LoadedRecording(
        made.hand,
        made.geometry,
        made.mounting,
        made.samples,
        made.events,
        start_utc=started.isoformat(),
        source={"device": DEVICE, "software": software_version()},
    )
    files = dict(writer.tree(recording, "simulated", "example", software=software_version()))
    subject = "sub-simulated"
    (motion,) = (p.removeprefix(f"{subject}/") for p in files if p.endswith("_motion.tsv"))
    days = f"filename\tacq_time\n{motion}\t{started.isoformat()}\n"
    save_file(writer.pack(files | {f"{subject}/{subject}_scans.tsv": days.encode()}), target)


def _fist(hand: HandGeometry, able: Ability, day: np.random.Generator) -> Performance:
    return perform.fist_and_stretch(hand, 3, (_bent(able, day), _straight(able, day)))


def _wrist(hand: HandGeometry, able: Ability, day: np.random.Generator) -> Performance:
    return perform.wrist_all_ways(hand, 2, able.wrist * _share(day))


def _tapping(hand: HandGeometry, able: Ability, day: np.random.Generator) -> Performance:
    opening = able.tap_opening + ANGLE_SD * day.standard_normal()
    return perform.tapping(hand, 10.0, able.tap_rate * _share(day), opening)


def _open_close(hand: HandGeometry, able: Ability, day: np.random.Generator) -> Performance:
    ends = _straight(able, day), _bent(able, day)
    return perform.open_close(hand, 10.0, able.open_rate * _share(day), ends=ends)


PERFORMED: Mapping[str, Callable[[HandGeometry, Ability, np.random.Generator], Performance]] = {
    "rom_fist": _fist,
    "rom_wrist": _wrist,
    "tapping": _tapping,
    "open_close": _open_close,
}


def _bent(able: Ability, day: np.random.Generator) -> Array:
    """The fist as far as the hand closes."""
    posture = perform.fist()
    for joint, share in able.fist.items():
        posture[COORDINATES[f"{joint}_flexion"]] *= share
    return _as_of_today(posture, day)


def _straight(able: Ability, day: np.random.Generator) -> Array:
    """Stretched as far as the hand opens."""
    posture = perform.stretched()
    for joint, lag in able.lag.items():
        posture[COORDINATES[f"{joint}_flexion"]] += np.radians(lag)
    return _as_of_today(posture, day)


def _as_of_today(posture: Array, day: np.random.Generator) -> Array:
    """With the day's own deviation in every joint of the long fingers."""
    for name, k in COORDINATES.items():
        if name.endswith("_flexion") and name.startswith(LONG_FINGERS):
            posture[k] += np.radians(ANGLE_SD) * day.standard_normal()
    return posture


def _share(day: np.random.Generator) -> float:
    return 1.0 + RATE_SD * float(day.standard_normal())
