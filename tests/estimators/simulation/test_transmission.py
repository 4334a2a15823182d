"""Samples lost on the way, and clocks that drift."""

import numpy as np
import pytest

from handscope.estimators.data.options import describe
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.person import Anatomy
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL, PRESETS
from handscope.estimators.simulation.transmission import (
    LINKS,
    OSCILLATOR,
    Transmission,
    clock_rate,
    transmit,
)

T = np.arange(0.0, 600.0, 0.01)
SENT = Block(Stream("imu", ("hand", "index_distal"), (GYR, ACC), 100.0), T, np.ones((len(T), 2, 6)))


def _lost(link: Transmission, seed: int = 0) -> np.ndarray:
    got = transmit(link, SENT, np.random.default_rng(seed))
    lost = np.isnan(got.values)
    assert (lost.all(axis=(1, 2)) == lost.any(axis=(1, 2))).all(), "a packet is lost as a whole"
    np.testing.assert_array_equal(got.t, SENT.t)
    return np.asarray(lost.all(axis=(1, 2)))


def test_by_wire_nothing_is_lost() -> None:
    assert not _lost(LINKS["wired"]).any()


def test_single_samples_are_lost_as_often_as_asked() -> None:
    lost = _lost(Transmission(lost=0.02))
    assert lost.mean() == pytest.approx(0.02, rel=0.1)
    assert not lost[0]


def test_bursts_are_as_many_and_as_long_as_asked() -> None:
    lost = np.array([_lost(Transmission(bursts=6.0, burst_length=0.1), seed) for seed in range(10)])
    starts = (np.diff(lost.astype(int), axis=1) == 1).sum()
    assert starts / 100 == pytest.approx(
        6.0, rel=0.15
    )  # in 100 minutes; the shortest fall between two samples
    assert lost.sum() / starts * 0.01 == pytest.approx(0.1, rel=0.15)


def test_a_clock_is_off_by_its_tolerance() -> None:
    rates = np.array(
        [
            clock_rate(Transmission(clock_drift=OSCILLATOR), np.random.default_rng(s))
            for s in range(400)
        ]
    )
    assert rates.std() == pytest.approx(0.01, rel=0.1)


def test_a_drifting_forearm_reads_what_happened_when_its_clock_said_another_time() -> None:
    drifting = Transmission(clock_drift=OSCILLATOR)
    wired, own = (
        simulate(
            ["rom_wrist"],
            "left",
            sized("left"),
            np.random.default_rng(2),
            IDEAL,
            forearm_rate=100.0,
            link=link,
        )
        for link in (LINKS["wired"], drifting)
    )
    clock = clock_rate(drifting, np.random.default_rng(2).spawn(2)[1])
    assert abs(clock - 1) > 1e-3
    exact, late = wired.samples["forearm"], own.samples["forearm"]
    assert len(late.t) == pytest.approx(clock * len(exact.t), abs=1)
    t = np.arange(1.0, exact.t[-1] - 1.0, 0.05)
    for axis in range(6):
        then, now = (
            np.interp(t * c, b.t, b.values[:, 0, axis]) for b, c in ((exact, 1.0), (late, clock))
        )
        np.testing.assert_allclose(now, then, atol=5e-3)
    np.testing.assert_array_equal(own.samples["imu"].values, wired.samples["imu"].values)


def test_every_size_names_its_source() -> None:
    for options in (Transmission, Anatomy):
        assert all(option.source and option.unit and option.meaning for option in describe(options))


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_makes_a_recording(name: str) -> None:
    made = simulate(["rest"], "left", sized("left"), np.random.default_rng(0), PRESETS[name])
    (block,) = made.samples.values()
    assert np.isfinite(block.values).all()
    assert block.stream.full_scale[GYR] == pytest.approx(np.radians(PRESETS[name].gyr_range))
