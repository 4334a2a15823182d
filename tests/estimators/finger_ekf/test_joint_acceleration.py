"""The acceleration that hand and thumb feel at their joint tells the heading between them, as well as it says."""

from dataclasses import dataclass

import numpy as np
import pytest

from handscope.estimators.finger_ekf.between_chains.chain_estimates import Estimates
from handscope.estimators.finger_ekf.joint_acceleration import block_sums, heading_update
from handscope.estimators.finger_ekf.joint_acceleration.block_sums import Readings
from handscope.estimators.finger_ekf.joint_acceleration.heading_update import JointAcceleration
from handscope.estimators.finger_ekf.sensor_to_segment import SIZE
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
RATE, EVERY = 100.0, heading_update.EVERY
ARMS = np.array([[-0.01, -0.04, -0.02], [-0.01, -0.025, 0.003]])  # m, the joint from the sensors
NOISE = heading_update.Noise(0.05, 1.0)


@dataclass(frozen=True)
class Sway:
    """Two segments that turn about three axes each and share a joint that sways, all by sines."""

    rng: np.random.Generator
    sway: float = 0.3  # m/s^2 of each sine, each axis
    hand_turns: float = 0.5  # rad
    acc_bias: float = 0.0  # m/s^2
    wobble: float = 0.0  # m/s^2, about a second long, of the thumb's sensor

    def readings(self, seconds: float) -> tuple[Readings, Array]:
        """Samples in which both fusions have the right heading, and the joint's rotation (n, 4)."""
        t = np.arange(0.0, seconds, 1 / RATE)
        a = self.sway * self._sines(t)
        parts = []
        for size, arm in zip((self.hand_turns, 0.6), ARMS):
            q = quat.exp(size * self._sines(t))
            turn = np.vstack([np.zeros(3), quat.log(quat.relative(q[:-1], q[1:]))])
            rate = np.vstack([turn[1:], turn[-1:]]) * RATE
            middle = 0.5 * (rate + turn * RATE)
            change = (rate - turn * RATE) * RATE
            at_sensor = quat.rotate(quat.conjugate(q), a + np.array([0.0, 0.0, GRAVITY])) - (
                np.cross(change, arm) + np.cross(middle, np.cross(middle, arm))
            )
            parts.append((turn, at_sensor + self.acc_bias * self.rng.normal(size=3), q))
        turn, force, q_EB = (np.stack(x, axis=1) for x in zip(*parts))
        if self.wobble:
            slow = np.repeat(self.rng.normal(size=(int(seconds) + 1, 3)), int(RATE), axis=0)
            force[:, 1] += self.wobble * slow[: len(t)]
        time = np.full((len(t), 2), 1 / RATE)
        return Readings(t, turn, time, force, q_EB), quat.relative(q_EB[:, 0], q_EB[:, 1])

    def _sines(self, t: Array) -> Array:
        f, phase = self.rng.uniform(0.1, 0.6, (3, 3)), self.rng.uniform(0, 2 * np.pi, (3, 3))
        return np.sin(2 * np.pi * f * t[:, None, None] + phase).mean(axis=1)


def _trembling(rng: np.random.Generator, rate: float, seconds: float) -> tuple[Readings, Array]:
    """A hand that trembles at 8 to 11 Hz about its wrist while the thumb moves; both sensors give means over the last sample, so that forces are half a sample older than the rates before and behind."""
    fine = 12
    t = np.arange(-fine, round(seconds * rate) * fine + fine) / (rate * fine)

    def sines(lowest: float, highest: float, n: int) -> Array:
        f, phase = rng.uniform(lowest, highest, (n, 3)), rng.uniform(0, 2 * np.pi, (n, 3))
        return np.asarray(np.sin(2 * np.pi * f * t[:, None, None] + phase).sum(axis=1)) / np.sqrt(n)

    palm_down = quat.exp(np.array([0.0, -np.pi / 2, 0.0]))
    turns = 0.1 * DEG * sines(8.0, 11.0, 40) + 3 * DEG * sines(0.1, 0.3, 5)
    hand = quat.multiply(palm_down, quat.exp(turns))
    at_wrist = 0.01 * sines(0.1, 0.3, 5)
    joint = quat.multiply(quat.exp(np.array([-0.5, 0.6, 0.2])), quat.exp(0.2 * sines(0.1, 0.6, 5)))
    parts = []
    for q, arm in zip((hand, quat.multiply(hand, joint)), ARMS):
        place = at_wrist + quat.rotate(hand, np.array([-0.006, 0.022, -0.018]))
        place = place - quat.rotate(q, arm)
        force = np.zeros_like(place)
        force[1:-1] = (place[2:] - 2 * place[1:-1] + place[:-2]) * (rate * fine) ** 2
        force = quat.rotate(quat.conjugate(q), force + np.array([0.0, 0.0, GRAVITY]))
        turned = np.cumsum(quat.log(quat.relative(q[:-1], q[1:])), axis=0)
        felt = np.cumsum(force, axis=0)
        rows = np.arange(2 * fine, len(t) - 1, fine)
        turn = turned[rows - 1] - turned[rows - fine - 1]
        parts.append((turn, (felt[rows] - felt[rows - fine]) / fine, q[rows]))
    turn, force, q_EB = (np.stack(x, axis=1) for x in zip(*parts))
    time = np.full((len(turn), 2), 1 / rate)
    at = np.arange(len(turn)) / rate
    return Readings(at, turn, time, force, q_EB), quat.relative(q_EB[:, 0], q_EB[:, 1])


def _thumb(q: Array, off: float, sd: float, up: Array) -> Estimates:
    """A chain whose first joint is known but for its heading; `off` rad from q."""
    P = np.zeros((SIZE, SIZE))
    P[:3, :3] = sd**2 * np.outer(up, up) + 1e-8 * np.eye(3)
    q_pc = np.tile(quat.IDENTITY, (3, 1))
    q_pc[0] = quat.multiply(q, quat.exp(-off * up))
    none = np.zeros((4, 3))
    return Estimates(q_pc, none, np.tile(quat.IDENTITY, (4, 1)), np.zeros((3, 3)), np.zeros(2), P)


def _up(q_EB: Array) -> Array:
    return np.asarray(quat.rotate(quat.conjugate(q_EB), np.array([0.0, 0.0, 1.0])))


def _blocks(
    readings: Readings,
    q: Array,
    off: float,
    sd: float,
    alternating: bool = False,
    rate: float = RATE,
) -> list[tuple[JointAcceleration, Estimates, float]]:
    """A thumb that is `off` anew in every block of EVERY seconds: what each block leaves, and of its heading."""
    n, found, state = int(EVERY * rate), [], None
    for first in range(0, len(readings.t) - n, n):
        last, off = first + n, -off if alternating else off
        begun = quat.multiply(q[first], quat.exp(-off * _up(readings.q_EB[first, 1])))
        state = heading_update.begin(readings.t[first], begun, readings.q_EB[first], state)
        part = Readings(*(x[first + 1 : last + 1] for x in readings))
        block_sums.accumulate(part, state.unknowns, state.sums)
        up = _up(readings.q_EB[last, 1])
        thumb = _thumb(q[last], off, sd, up)
        state, thumb = heading_update.close(
            NOISE, state, thumb, up, readings.q_EB[last], readings.t[last]
        )
        left = quat.log(quat.relative(thumb.q_pc[0], q[last])) @ up
        found.append((state, thumb, float(left)))
    return found


@pytest.mark.parametrize("off", [-8.0, 8.0])
def test_a_wrong_heading_is_put_right_and_lever_arms_are_found(
    rng: np.random.Generator, off: float
) -> None:
    state, _, left = _blocks(*Sway(rng, sway=2.0).readings(61.0), off * DEG, 10 * DEG)[-1]
    assert abs(left) < 0.1 * abs(off) * DEG
    np.testing.assert_allclose(state.unknowns[:6].reshape(2, 3), ARMS, atol=0.004)


def test_a_hand_that_rests_while_the_thumb_moves_tells_nothing(rng: np.random.Generator) -> None:
    """Else the thumb's own turning would count as knowledge of a heading that nothing shows."""
    found = _blocks(
        *Sway(rng, sway=0.0, hand_turns=0.0, acc_bias=0.05).readings(121.0), 8 * DEG, 10 * DEG
    )
    for _, thumb, left in found[2:]:
        up = np.linalg.eigh(thumb.P[:3, :3])[1][:, -1]
        assert np.sqrt(up @ thumb.P[:3, :3] @ up) > 9 * DEG
        assert left == pytest.approx(8 * DEG, abs=1 * DEG)


def test_the_heading_is_as_well_known_as_it_says() -> None:
    """Sensors that wobble on the skin more than is usual, and accelerometers with biases; blocks after the first minute of 40 people."""
    rng, squares = np.random.default_rng(11), []
    for _ in range(40):
        off = 5 * DEG * rng.normal()
        sway = Sway(rng, sway=rng.uniform(0.2, 1.0), acc_bias=0.05, wobble=0.2)
        for _, thumb, left in _blocks(*sway.readings(181.0), off, 5 * DEG)[6:]:
            squares.append(left**2 / np.linalg.eigvalsh(thumb.P[:3, :3])[-1])
    assert 0.5 < np.mean(squares) < 1.5


@pytest.mark.parametrize("seed", range(4))
def test_a_trembling_hand_does_not_turn_the_heading(seed: int) -> None:
    """Half a sample of 60 Hz lies between rates and forces, a twelfth of such a tremor's period: levers are misjudged alike in every block, and with them the heading."""
    readings, q = _trembling(np.random.default_rng(seed), 60.0, 151.0)
    found = _blocks(readings, q, 0.0, 30 * DEG, rate=60.0)[3:]
    off = np.array([left for *_, left in found])
    sd = np.sqrt([np.linalg.eigvalsh(thumb.P[:3, :3])[-1] for _, thumb, _ in found])
    assert abs(off.mean()) < 5 * DEG
    assert np.mean((off / sd) ** 2) < 1.5


def test_a_filter_that_is_sure_of_a_wrong_heading_is_put_right_once_two_blocks_agree(
    rng: np.random.Generator,
) -> None:
    """Each block begins with a thumb that is 70 deg off and believes in 0.5: one is rejected, the next believed."""
    found = _blocks(*Sway(rng, sway=2.0).readings(121.0), 70 * DEG, 0.5 * DEG)
    rejected, believed = sorted(found[-2:], key=lambda x: -abs(x[2]))
    assert rejected[2] > 67 * DEG
    assert abs(believed[2]) < 3 * DEG
    assert np.sqrt(np.linalg.eigvalsh(believed[1].P[:3, :3])[-1]) > 0.5 * DEG


def test_innovations_larger_than_both_explain_make_the_noise_larger(
    rng: np.random.Generator,
) -> None:
    """A heading that is off to one side and then to the other is no filter that is wrong."""
    readings, q = Sway(rng, sway=2.0).readings(301.0)
    usual = _blocks(readings, q, 0.2 * DEG, 0.5 * DEG)
    turned = _blocks(readings, q, 5 * DEG, 0.5 * DEG, alternating=True)
    assert heading_update.excess(usual[-1][0].noise_stats) < 1.5
    assert heading_update.excess(turned[-1][0].noise_stats) > 3


def test_sums_do_not_depend_on_where_rows_are_cut(rng: np.random.Generator) -> None:
    readings, q = Sway(rng).readings(4.0)
    whole, parts = (block_sums.begin(0.0, 0.1) for _ in range(2))
    unknowns = 0.01 * rng.normal(size=block_sums.UNKNOWNS)
    block_sums.accumulate(readings, unknowns, whole)
    for first in range(0, len(q), 37):
        rows = Readings(*(np.ascontiguousarray(x[first : first + 37]) for x in readings))
        block_sums.accumulate(rows, unknowns, parts)
    for a, b in zip(whole, parts):
        np.testing.assert_array_equal(a, b)


def test_a_sample_that_is_missing_is_left_out(rng: np.random.Generator) -> None:
    readings, _ = Sway(rng).readings(4.0)
    readings.force[100:130, 0] = np.nan
    readings.time[200:203, 1] = 0.0
    sums = block_sums.begin(0.0, 0.0)
    block_sums.accumulate(readings, np.zeros(block_sums.UNKNOWNS), sums)
    assert np.isfinite(sums.normal).all()
    assert 65 / 80 < sums.gram[0] * block_sums.BOX / 4.0 < 1
