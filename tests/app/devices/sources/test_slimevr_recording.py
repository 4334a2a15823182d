"""A movement simulated elsewhere comes in as SlimeVR packets, is recorded and processed as its native recording."""

import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import Simulated
from handscope.sessions.formats import recordings
from tests.app.devices.sources import slime_trackers as slime
from tests.oriented import oriented_strips
from tests.simulated import DEG, INSTANT, with_samples

SECONDS = 9.0
PARAMS = replace(INSTANT, pose_duration=2.5)  # the sender's clock is not quite even
FIRST = {"hand": 17, "thumb": 21, "index": 24, "middle": 27, "ring": 30, "little": 33}


def _cut() -> Simulated:
    whole = oriented_strips("left")
    samples = {n: b.between(0.0, SECONDS) for n, b in whole.samples.items() if n != "forearm"}
    return with_samples(whole, samples)


def _play(recording: Simulated, port: int, begun: list[float]) -> None:
    """Shake hands until a server answers, then send every sample in its time."""
    positions = {n: range(FIRST[n], FIRST[n] + 3) for n in recording.samples}
    with closing(slime.tracker_socket()) as tracker:
        address = ("127.0.0.1", port)
        tracker.settimeout(0.5)
        while True:
            tracker.sendto(slime.handshake(), address)
            try:
                if tracker.recv(1500).startswith(b"\x03"):
                    break
            except (TimeoutError, ConnectionError):
                continue
        number = 1
        sensors = [
            (p - 17, p, name, k)
            for name, block in recording.samples.items()
            for k, p in enumerate(positions[name][: len(block.stream.sensors)])
        ]
        for sensor, position, _, _ in sensors:
            tracker.sendto(slime.sensor_info(number, sensor, position), address)
            number += 1
        start = time.monotonic() + 0.2
        begun.append(start)
        for row, t in enumerate(recording.samples["hand"].t):
            time.sleep(max(0.0, start + t - time.monotonic()))
            parts = [
                (17, slime.rotation(sensor, recording.samples[name].values[row, k]))
                for sensor, _, name, k in sensors
            ]
            tracker.sendto(slime.bundle(number, parts), address)
            number += 1


@pytest.mark.slow
def test_angles_are_those_of_the_native_recording(tmp_path: Path) -> None:
    recording, begun = _cut(), list[float]()
    with closing(slime.tracker_socket()) as free:
        port = free.getsockname()[1]
    thread = threading.Thread(target=_play, args=(recording, port, begun), daemon=True)
    thread.start()
    out = tmp_path / "slime.mcap"
    assert main(["record", f"slimevr://127.0.0.1:{port}", "--out", str(out)]) == 0
    thread.join()
    read = recordings.load(out)
    assert read.hand == "left"
    assert {n: len(b.t) for n, b in read.samples.items() if "hand" in n} == {
        "hand_orientation": len(recording.samples["hand"].t)
    }
    read = read.with_events(recording.events)
    ours = process(m2, PARAMS, recording).trajectory
    given = process(m2, PARAMS, read).trajectory
    assert len(given) == len(ours)  # sample for sample: when each came is the radio's matter
    difference = np.abs(given.angles - ours.angles)
    assert np.nanmax(difference) < 0.2 * DEG
