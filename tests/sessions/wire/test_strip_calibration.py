"""Raw samples of a strip, corrected by what its flash says: the same live and from the recording, whose bytes stay raw."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, FORCE, GYR, TORQUE, Block, Stream, join
from handscope.estimators.sensors.imu_calibration import ImuCalibration, apply
from handscope.sessions.files import native
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.strip_calibration import correction_of, message_of
from tests.estimators.sensors.test_imu_calibration import drawn
from tests.glove import as_float32, bursts, frames, identity, info, strip
from tests.simulated import STRIPS, cut, in_strips

INDEX = cut(in_strips("left").samples["index"], [300])[0]
RAW = replace(strip("index"), raw=True)
KEPT = [message_of(drawn(k), RAW.slot, k) for k in range(3)]
CORRECTED = apply([correction_of(m) for m in KEPT], (GYR, ACC), as_float32(INDEX))


def fed(messages: list[wire.Message], correct: bool = True) -> tuple[Assembler, Block | None]:
    assembler, encoder = Assembler(correct=correct), Encoder()
    blocks = [b for f in frames(messages, encoder) for b in assembler.feed(f, 100.0)]
    return assembler, join(blocks) if blocks else None


def test_samples_of_a_raw_strip_are_corrected_by_its_calibrations() -> None:
    _, block = fed([identity(), RAW, *KEPT, info("index"), *bursts("index", INDEX, info("index"))])
    assert block is not None
    np.testing.assert_array_equal(block.values, CORRECTED)
    assert block.stream.full_scale[GYR] < 40.0


def test_samples_of_a_strip_that_corrects_itself_are_left_alone() -> None:
    _, block = fed(
        [identity(), strip("index"), *KEPT, info("index"), *bursts("index", INDEX, info("index"))]
    )
    assert block is not None
    np.testing.assert_array_equal(block.values, as_float32(INDEX))
    assert block.stream.full_scale[GYR] == 40.0


@pytest.mark.parametrize("known", [0, 2])
def test_raw_samples_wait_until_every_calibration_is_told(known: int) -> None:
    sent = bursts("index", INDEX, info("index"))
    before = [identity(), RAW, *KEPT[:known], info("index"), *sent[:20]]
    assert fed(before)[1] is None
    _, block = fed([*before, *KEPT[known:], *sent[20:]])
    assert block is not None
    np.testing.assert_array_equal(block.values, CORRECTED)


def test_another_strip_at_the_same_slot_is_not_corrected_by_the_first_ones_calibrations() -> None:
    sent = bursts("index", INDEX, info("index"))
    begin = [identity(), RAW, *KEPT, info("index"), *sent[:10]]
    other = replace(RAW, strip_id=77)
    assembler, block = fed([*begin, other, *sent[10:]])
    assert block is not None and len(block.t) == sum(s.count for s in sent[:10])
    assert assembler.waiting == len(sent) - 10
    _, block = fed([*begin, replace(RAW, attached=False), RAW, info("index"), *sent[10:]])
    assert block is not None and len(block.t) == sum(s.count for s in sent[:10])


POINTS = ("thumb_tip_force", "index_tip_force")
GAINS = 9.0 + np.random.default_rng(1).normal(size=(2, 6, 6))
OFFSETS = (0.5, 0.25, 0.125, 1.0, 2.0, 3.0)


def fingertips(
    quantities: tuple[str, ...], raw: bool, axes: int = 6, at_limit: float = 0.0
) -> Block:
    """Two force sensors that send the same twelve samples of everything, calibrated with 3 or 6 axes; the first of 5 at a limit where there is one."""
    worn = wire.Strip(4, True, 7, POINTS, (), raw)
    told = [
        ForceSensorCalibration(
            4,
            k,
            0.01 * (k + 1),
            0.005 if k else None,
            OFFSETS[:axes],
            tuple(map(float, GAINS[k, :axes, :axes].ravel())),
        )
        for k in (0, 1)
    ]
    described = wire.StreamInfo(
        9,
        4,
        0,
        quantities,
        wire.Format.FLOAT32,
        12.0,
        (1.0,) * len(quantities),
        (at_limit,) * len(quantities),
    )
    values = np.repeat(np.arange(1.0, 13.0)[:, None], 3 * len(quantities) * 2, axis=1).reshape(
        12, 2, -1
    )
    sent = bursts(
        "force",
        Block(Stream("force", POINTS, quantities, 12.0), np.arange(12) / 12, values),
        described,
    )
    early = sent[: 1 if raw else 0]
    _, block = fed([identity(), worn, described, *early, *told, *sent[len(early) :]])
    assert block is not None
    assert block.stream.scale_sd == {POINTS[0]: pytest.approx(0.01), POINTS[1]: pytest.approx(0.02)}
    assert block.stream.turn_sd == {POINTS[1]: pytest.approx(0.005)}
    return block


def test_raw_forces_wait_for_their_calibration_and_are_corrected_by_it() -> None:
    three, six = fingertips((FORCE,), True, 3), fingertips((FORCE, TORQUE), True)
    for block, axes in ((three, 3), (six, 6)):
        assert len(block.t) == 12, "the burst before the calibration waited"
        for k in (0, 1):
            expected = (np.arange(1.0, 13.0)[:, None] - OFFSETS[:axes]) @ GAINS[
                k, :axes, :axes
            ].astype("<f4").T
            np.testing.assert_allclose(block.values[:, k], expected, rtol=1e-6)
    assert np.isnan(fingertips((FORCE,), True).values).all(), (
        "six axes need the torques in the same stream"
    )


def test_raw_forces_at_their_limit_are_infinite_and_those_of_a_strip_that_corrects_itself_are_left_alone() -> (
    None
):
    limited = fingertips((FORCE,), True, 3, at_limit=10.0)
    assert FORCE not in limited.stream.full_scale
    np.testing.assert_array_equal(
        np.isinf(limited.values).all(axis=(1, 2)), np.arange(1, 13) >= 9.8
    )
    itself = fingertips((FORCE,), False, 3, at_limit=10.0)
    np.testing.assert_array_equal(itself.values[:, 0, 0], np.arange(1.0, 13.0))
    assert itself.stream.full_scale == {FORCE: 10.0}


def test_a_calibration_keeps_its_numbers_on_the_wire() -> None:
    for k in range(20):
        message = message_of(drawn(k), 2, 1)
        assert message_of(correction_of(message), 2, 1) == message
    assert correction_of(message_of(ImuCalibration(), 0, 0)).trivial


def test_the_recording_stays_raw_and_opens_corrected_to_the_last_bit(tmp_path: Path) -> None:
    path, assembler, live, encoder = tmp_path / "r.mcap", Assembler(), [], Encoder()
    messages = [identity(), RAW, *KEPT, info("index"), *bursts("index", INDEX, info("index"))]
    with Recorder(path, {}, 0.0) as recorder:
        for k, data in enumerate(frames(messages, encoder)):
            recorder.write(data, k * 1e-3)
            live += assembler.feed(data, k * 1e-3)
    np.testing.assert_array_equal(native.load(path).samples["index"].values, join(live).values)
    np.testing.assert_array_equal(
        native.load(path, correct=False).samples["index"].values, as_float32(INDEX)
    )
    assert native.load(path).strip_ids == dict.fromkeys(STRIPS["index"], f"{RAW.strip_id:x}")
