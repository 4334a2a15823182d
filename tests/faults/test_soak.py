"""A glove of 17 sensors at 200 Hz for a long time: memory and latency stay where they were. In a minute here, for two real hours by `make soak`."""

import asyncio
import gc
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from handscope.app.live import tracking as live_tracking
from handscope.app.live.tracking import Tracking
from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Message
from handscope.validation.benchmarks import live
from handscope.validation.benchmarks.server_under_test import Client, begin_tasks, glove, server
from tests.app.devices.virtual import wait_for
from tests.glove import NS, ON, bursts, identity, info, strip
from tests.simulated import INSTANT, strips_of

SOAK = float(os.environ.get("HANDSCOPE_SOAK", "0"))  # s
PAGE = os.sysconf("SC_PAGE_SIZE")
MOST = 4.0  # MB that may come on top between the first third and the end


def memory(pid: int | str = "self") -> float:
    """MB that a process has in memory."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 2**20


def descendants(pid: int) -> list[int]:
    """A process and all that it started, those that record and draw among them, oldest first."""
    children = [
        int(p)
        for t in Path(f"/proc/{pid}/task").iterdir()
        for p in (t / "children").read_text().split()
    ]
    return [pid, *sorted(p for child in children for p in descendants(child))]


def sent(samples: Mapping[str, Block], rounds: int) -> Iterator[tuple[float, Message]]:
    """The samples over and over in bursts of 20 ms, each message with its time."""
    infos = {name: info(name, b.stream.rate) for name, b in samples.items()}
    for told in (identity(), *(m for name in samples for m in (strip(name), infos[name]))):
        yield ON, told
    length = max(b.t[-1] for b in samples.values()) + 0.005
    for k in range(rounds):
        shifted = {n: Block(b.stream, b.t + k * length, b.values) for n, b in samples.items()}
        every = [
            m for n, b in shifted.items() for m in bursts(n, b, infos[n], 4, first=k * len(b.t))
        ]
        yield from ((m.t_sent / NS, m) for m in sorted(every, key=lambda m: m.t_sent))


@pytest.fixture
def new_garbage_alone() -> Iterator[None]:
    """A collection looks at what came since: modules and what other tests keep would take a tenth of a second each time."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.slow
@pytest.mark.usefixtures("new_garbage_alone")
def test_memory_does_not_grow_with_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recorder, decoder and tracker at work; what the tracker keeps on purpose is made short."""
    monkeypatch.setattr(live_tracking, "PAST_SAMPLES", 8.0)
    monkeypatch.setattr(live_tracking, "PAST_POSES", 4.0)
    drawn = np.random.default_rng(5)
    recording = strips_of(
        simulate(
            ["initial_pose", "wiggle"],
            "left",
            sized("left"),
            drawn,
            IDEAL,
            segments=SEGMENTS,
            rate=200.0,
        )
    )
    encoder, assembler, seen = Encoder(), Assembler(), list[tuple[float, float]]()
    pose = initial_pose.pose_of(recording.events[0])
    tracking = Tracking(m2, INSTANT, "left", recording.geometry, lambda rows: None)
    with tracking, Recorder(tmp_path / "r.mcap", {"hand": "left"}, 100.0) as recorder:
        for k, (at, message) in enumerate(sent(recording.samples, 4)):
            frame = encoder.frame(message)
            recorder.write(frame, 100.0 + at)
            tracking.feed(assembler.feed(frame, 100.0 + at))
            if k % 500 == 0:
                newest = at - ON - 0.1
                wait_for(lambda newest=newest: tracking.newest_sample() >= newest or newest < 1.0)
                if tracking.calibration is None and newest > pose.end + 0.3:
                    tracking.calibrate(pose)
                gc.collect()
                seen.append((newest, memory()))
    t, used = np.array(seen).T
    assert tracking.calibration is not None and tracking.failures == tracking.skipped == 0
    assert t[-1] > 50.0
    assert used[-3:].mean() - used[(t > 15) & (t < 25)].mean() < MOST, used.round(1).tolist()


@pytest.mark.skipif(SOAK == 0.0, reason="takes hours: make soak")
def test_a_real_server_stays_as_it_was() -> None:
    with tempfile.TemporaryDirectory() as folder:
        port = Path(folder) / "glove"
        with (
            glove(port, "--rate", "200", "--task", "tapping"),
            server(Path(folder) / "data") as (address, pid),
        ):
            client = Client(address)
            station = begin_tasks(client, port)
            began, told, family = time.monotonic(), list[list[float]](), descendants(pid)
            while time.monotonic() - began < SOAK:
                _, ages = asyncio.run(live.watch(client, [station], live.VIEWERS, live.SECONDS))
                assert descendants(pid) == family, "a process of the server's ended or began"
                told.append(
                    [time.monotonic() - began, float(np.percentile(ages, 99)), *map(memory, family)]
                )
                print(  # noqa: T201
                    "%7.0f s  p99 %5.1f ms " % tuple(told[-1][:2]),  # noqa: UP031
                    *(f"{m:6.1f} MB" for m in told[-1][2:]),
                    flush=True,
                )
                time.sleep(min(48.0, SOAK / 20))
            strips = client.call("GET", f"/api/stations/{station}")["glove"]["strips"]
            client.call("DELETE", f"/api/stations/{station}")
    t, p99, *used = np.array(told).T
    assert sum(s["lost"] for s in strips) == 0
    late, early = (
        t > 0.8 * SOAK,
        (t > 0.2 * SOAK) & (t < 0.4 * SOAK),
    )  # ten minutes of poses are kept on purpose
    for one in used:
        assert one[late].mean() < 1.05 * one[early].mean(), one.round(1).tolist()
    assert np.median(p99[late]) < 1.5 * np.median(p99[early]), p99.round(1).tolist()
