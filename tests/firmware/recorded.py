"""What any of the firmware's gloves must show once it was recorded: nothing lost, and the exercise that its simulated hand does."""

import csv
from pathlib import Path

import numpy as np

from handscope.estimators.data.samples import GYR, Block
from handscope.sessions.formats import recordings as formats
from tests.firmware.conftest import run_handscope

RATE, SECONDS = 200.0, 10.0
SAMPLES = 12.0  # s of the glove's own time after which it falls silent: a busy machine may take longer for them
FIST_DEG = {
    "index_mcp": 60.0,
    "index_pip": 80.0,
    "index_dip": 45.0,
    "thumb_mcp": 30.0,
    "thumb_ip": 40.0,
}  # firmware/boards/simulated/hand.c
FIST_HZ = 0.5


def record(port: str, folder: Path) -> Path:
    """Record 17 sensors by the real program until the glove falls silent; the recording."""
    path = folder / "glove.mcap"
    run_handscope("record", port, "--out", str(path))
    return path


def assert_nothing_is_lost(path: Path) -> None:
    recording = formats.load(path, None)
    assert sum(len(stream.sensors) for stream in recording.streams) == 17
    assert not any(recording.losses.values())
    assert recording.warnings == ()
    for block in recording.samples.values():
        assert block.stream.rate == RATE
        assert len(block.t) >= RATE * SECONDS
        assert np.isfinite(block.values).all()
        np.testing.assert_allclose(
            np.diff(block.t), 1 / RATE, atol=2e-9
        )  # s: the stamps are in whole ns


def assert_fists_are_measured(path: Path, folder: Path) -> None:
    """The range of motion of the simulated fist, within 3 deg of what the hand does."""
    run_handscope("assess", str(path), "--out", str(folder))
    lines = [
        line
        for line in (folder / "figures.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    found = {row["name"]: float(row["value"]) for row in csv.DictReader(lines) if row["value"]}
    for joint, angle in FIST_DEG.items():
        assert abs(found[f"{joint}_flexion_range"] - angle) < 3, joint


def skew(path: Path) -> float:
    """Largest time by which one sensor of a finger sees the fist later than another, s, from the phase at its own frequency."""
    delays = []
    for name, block in formats.load(path, None).samples.items():
        if name not in ("hand", "forearm"):
            phases = [_phase(block, k) for k in range(3)]
            delays += list(np.diff([p for p in phases if p is not None]) / (2 * np.pi * FIST_HZ))
    return float(np.abs(delays).max())


def _phase(block: Block, sensor: int) -> float | None:
    """Phase of the sensor's rate about its axis of flexion over whole periods; None for one that does not move."""
    t, rate = block.t - block.t[0], block.values[:, sensor, block.stream.axes(GYR)]
    moving = (t > 5.0) & (t < 9.0)
    axis = rate[moving][:, np.argmax(np.ptp(rate[moving], axis=0))]
    angle = 2 * np.pi * FIST_HZ * t[moving]
    a, b, _ = np.linalg.lstsq(
        np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1), axis, rcond=None
    )[0]
    return float(np.arctan(b / a)) if np.hypot(a, b) > 0.3 else None  # rad/s
