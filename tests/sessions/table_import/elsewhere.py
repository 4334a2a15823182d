"""A recording simulated by a program that shares nothing with this one, and how far another recording of the same movement is from it."""

import csv
from pathlib import Path

import numpy as np

from handscope.app.cli import main
from handscope.validation.independent.simulator import recording_files
from handscope.validation.independent.simulator.force_sensors import (
    Cuffs,
    draw_sensor,
    simulate_readings,
)
from handscope.validation.independent.simulator.hand import measured
from handscope.validation.independent.simulator.pinch import Held, pinched
from tests.simulated import DEG

Angles = dict[str, np.ndarray]


def lift(folder: Path) -> Path:
    """Something is lifted between thumb and index finger, by sensors with errors, as Motion-BIDS in a new folder."""
    rng = np.random.default_rng(4)
    done, cuffs = pinched(Held(mass=0.3), "left", rng), Cuffs()
    sensors = [draw_sensor(cuffs, rng) for _ in recording_files.FINGERS]
    forces = simulate_readings(done, cuffs, sensors, rng)
    recording_files.written(folder, done, measured(done.hand, rng), forces, {})
    (events,) = folder.rglob("*_events.tsv")
    rows = events.read_text().splitlines()
    ranges = rows[-1].replace("lift", "rom")  # of the same movement, which needs no forces
    events.write_text("\n".join([*rows, ranges]) + "\n")
    return folder


def processed(recording: Path, out: Path) -> Angles:
    """Joint angles, deg, by name, and the times, as the command line writes them."""
    assert main(["process", str(recording), "--method", "m2", "--out", str(out)]) == 0
    (table,) = out.rglob("*_desc-m2_motion.tsv")
    channels = table.with_name(table.name.replace("_motion.tsv", "_channels.tsv"))
    rows = [line.split("\t") for line in channels.read_text().splitlines()]
    values = np.genfromtxt(table, delimiter="\t")
    kind, unit = rows[0].index("type"), rows[0].index("units")
    found = {}
    for k, row in enumerate(rows[1:]):
        if row[kind] in ("JNTANG", "LATENCY"):
            name = row[0] if row[kind] == "JNTANG" else "t"
            found[name] = values[:, k] / (DEG if row[unit] == "rad" else 1.0)
    return found


def ranges_of_motion(recording: Path, out: Path) -> dict[str, float]:
    """Figures of `handscope assess`, deg, by name; a report is made with them."""
    report = out.with_suffix(".pdf")
    words = ["assess", str(recording), "--method", "m2", "--out", str(out)]
    assert main([*words, "--report", str(report)]) == 0
    assert report.read_bytes().startswith(b"%PDF")
    lines = (out / "figures.csv").read_text("utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return {r["name"]: float(r["value"]) for r in rows if r["task"] == "rom" and r["value"]}


def require_same_ranges(native: Path, ours: Path, folder: Path, within: float) -> None:
    """Both are assessed, and the same ranges of motion found, within so many deg."""
    expected = ranges_of_motion(native, folder / "assessed-native")
    found = ranges_of_motion(ours, folder / "assessed")
    assert found.keys() == expected.keys() and len(found) >= 27
    assert max(abs(found[name] - value) for name, value in expected.items()) < within


def largest_difference(a: Angles, b: Angles, since: float = 0.0) -> float:
    """Over all angles, deg, where both know them, from a time of the first on, s."""
    (t_a, t_b), names = (x["t"] for x in (a, b)), sorted(set(a) & set(b) - {"t"})
    assert len(names) >= 6
    count = min(len(t_a), len(t_b))
    assert abs(len(t_a) - len(t_b)) < 2 and np.ptp(t_a[:count] - t_b[:count]) < 1e-3
    rows = np.flatnonzero(t_a[:count] >= since)
    differences = [np.abs(a[n][rows] - b[n][rows]) for n in names]
    known = [float(np.nanmax(d)) for d in differences if np.isfinite(d).any()]
    assert len(known) >= 9  # of thumb and index finger
    return max(known)
