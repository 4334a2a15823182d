"""What happens to samples between the sensor and the recording: lost one by one or in bursts, taken by a clock that is not the recording's.

In      samples of one stream, a random generator
Out     the same with NaN rows where a packet was lost: a packet holds one sample of all sensors of its stream
Source  every size is an option with its source
Limits  a drifting clock keeps its rate for the whole recording
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.samples import Block
from handscope.estimators.numerics.typing import Array

VALTIN = "Valtin 2017, 2.2"


@dataclass(frozen=True, kw_only=True)
class Transmission:
    """Sizes from which losses and clocks are drawn."""

    lost: float = option(
        0.0,
        "1",
        "share of samples lost one by one",
        f"none by wire, the sensors' FIFO keeps them: {VALTIN}",
    )
    bursts: float = option(
        0.0, "1/min", "stretches of lost samples in a minute", f"none by wire: {VALTIN}"
    )
    burst_length: float = option(
        0.1,
        "s",
        "mean length of such a stretch",
        "10 samples at 100 Hz, the outage that integration bridges badly; ours",
    )
    clock_drift: float = option(
        0.0,
        "ppm",
        "rate error of a forearm sensor's own clock, standard deviation",
        f"0: synchronised, {VALTIN}",
    )


WIRED = Transmission()
QUARTZ = 20.0  # ppm, the usual tolerance of a wireless module's 32 MHz quartz: nRF52832 product specification, 2.4 GHz radio needs +-40 ppm
OSCILLATOR = 1e4  # ppm: the MPU-9250's own oscillator is within 1 %, product specification PS-MPU-9250A-01, 3.4
# a worn link that works; shares ours
WIRELESS = Transmission(lost=0.005, bursts=1.0, clock_drift=QUARTZ)
# a link at the end of its range; shares ours
FAILING = Transmission(lost=0.05, bursts=6.0, clock_drift=OSCILLATOR)
LINKS = {"wired": WIRED, "wireless": WIRELESS, "failing": FAILING}


def transmit(link: Transmission, block: Block, rng: np.random.Generator) -> Block:
    """The samples that arrive; what is lost is a row of NaN. The first sample always arrives."""
    lost = rng.random(len(block.t)) < link.lost
    for start, length in _outages(link, block.t, rng):
        lost |= (block.t >= start) & (block.t < start + length)
    lost[:1] = False
    return (
        block
        if not lost.any()
        else replace(block, values=np.where(lost[:, None, None], np.nan, block.values))
    )


def clock_rate(link: Transmission, rng: np.random.Generator) -> float:
    """Seconds that a stream's own clock counts in one true second."""
    return float(1.0 + 1e-6 * link.clock_drift * rng.normal())


def _outages(link: Transmission, t: Array, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Onsets and lengths: a Poisson process, exponential lengths."""
    span = float(t[-1] - t[0]) if len(t) else 0.0
    n = int(rng.poisson(link.bursts * span / 60))
    return list(
        zip(t[:1].repeat(n) + span * rng.random(n), link.burst_length * rng.exponential(size=n))
    )
