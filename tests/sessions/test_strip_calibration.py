"""Raw samples of a strip, corrected by what its flash says: the same live and from the recording, whose bytes stay raw."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimators.imu_calibration import ImuCalibration, apply
from estimators.samples import ACC, GYR, Block, join
from sessions import native
from sessions.recorder import Recorder
from sessions.wire import messages as wire
from sessions.wire.assembly import Assembler, correction_of, message_of
from sessions.wire.framing import Encoder
from tests.estimators.test_imu_calibration import drawn
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
    _, block = fed([identity(), strip("index"), *KEPT, info("index"), *bursts("index", INDEX, info("index"))])
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
    np.testing.assert_array_equal(native.load(path, correct=False).samples["index"].values, as_float32(INDEX))
    assert native.load(path).strip_ids == dict.fromkeys(STRIPS["index"], f"{RAW.strip_id:x}")
