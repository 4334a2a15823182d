"""From messages to blocks on the recording's time base: hot-plug, restarts, foreign clocks, losses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Event, join
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import WAITING, Assembler, StreamCount
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Format, Mark, Message, Pong, Samples
from tests.glove import (
    NS,
    ON,
    Sent,
    as_float32,
    bursts,
    frames,
    identity,
    info,
    strip,
    whole_session,
)
from tests.sessions.wire.test_messages import ANY
from tests.simulated import cut, in_strips

HAND = cut(in_strips("left").samples["hand"], [300])[0]
INDEX = cut(in_strips("left").samples["index"], [300])[0]


class Line:
    """An assembler with the encoder of the device at its other end."""

    def __init__(self) -> None:
        self.assembler, self.encoder, self.blocks = Assembler(), Encoder(), list[Block]()

    def send(self, *messages: Message, at: float = 100.0) -> list[Block]:
        got = self.assembler.feed(b"".join(frames(messages, self.encoder)), at)
        self.blocks += got
        return got

    def of(self, name: str) -> Block:
        return join([b for b in self.blocks if b.stream.name == name])


def _fed(sent: list[Sent]) -> Line:
    line = Line()
    for s in sent:
        line.send(s.message, at=s.arrival)
    return line


@pytest.mark.parametrize("kind", Format)
def test_samples_come_out_as_they_went_in(kind: Format) -> None:
    samples = in_strips("left").samples
    line = _fed(whole_session(samples, kind))
    assert {b.stream.name for b in line.blocks} == set(samples)
    for name, block in samples.items():
        got = line.of(name)
        np.testing.assert_allclose(got.t, block.t - samples["hand"].t[0], atol=2e-9)
        if kind is Format.FLOAT32:
            np.testing.assert_array_equal(got.values, as_float32(block))
        else:
            np.testing.assert_allclose(got.of(GYR), block.of(GYR), atol=0.5 / 512 + 1e-9)
            np.testing.assert_allclose(got.of(ACC), block.of(ACC), atol=0.5 / 128 + 1e-9)
        assert got.stream.sensors == block.stream.sensors
        assert got.stream.full_scale == {GYR: 40.0, ACC: 160.0}
        assert line.assembler.counts[name] == StreamCount(len(block.t))


@given(st.lists(st.integers(0, 2**32), max_size=30))
def test_the_bytes_may_be_cut_anywhere(where: list[int]) -> None:
    sent = whole_session({"hand": HAND, "index": INDEX}, Format.INT16)
    data = b"".join(frames(s.message for s in sent))
    edges = [0, *sorted(k % len(data) for k in where), len(data)]
    assembler = Assembler()
    got = [b for a, z in zip(edges, edges[1:]) for b in assembler.feed(data[a:z], 100.0)]
    (whole,) = (b for b in Assembler().feed(data, 100.0) if b.stream.name == "index")
    pieces = join([b for b in got if b.stream.name == "index"])
    (together,) = (
        b
        for b in Assembler().feed_all((100.0, data[a:z]) for a, z in zip(edges, edges[1:]))
        if b.stream.name == "index"
    )
    for block in (pieces, together):
        np.testing.assert_array_equal(block.t, whole.t)
        np.testing.assert_array_equal(block.values, whole.values)


@given(
    st.lists(
        st.one_of(
            ANY,
            ANY.map(
                lambda m: replace(m, stream=10, slot=0) if isinstance(m, wire.StreamInfo) else m
            ),
        ),
        max_size=30,
    )
)
def test_nothing_that_a_device_sends_makes_it_raise(messages: list[Message]) -> None:
    line = Line()
    for k, message in enumerate(messages):
        line.send(message, at=100.0 + k)
    line.send(
        identity(),
        strip("hand"),
        info("hand"),
        *messages,
        *bursts("hand", HAND, info("hand")),
        at=200.0,
    )
    for block in line.blocks:
        assert (np.diff(block.t) > 0).all()
        assert block.values.shape == (
            len(block.t),
            len(block.stream.sensors),
            3 * len(block.stream.quantities),
        )


@given(st.permutations(["strip", "info", "bursts"]))
def test_bursts_wait_until_strip_and_stream_are_described(order: list[str]) -> None:
    line, sent = Line(), bursts("index", INDEX, info("index"))
    parts = {"strip": [strip("index")], "info": [info("index")], "bursts": sent[:20]}
    for part in order:
        line.send(*parts[part])
    line.send(*sent[20:])
    got = line.of("index")
    np.testing.assert_array_equal(got.values, as_float32(INDEX))
    assert line.assembler.counts["index"] == StreamCount(len(INDEX.t))
    assert (line.assembler.undescribed, line.assembler.waiting) == (0, 0)


def test_bursts_that_waited_too_long_are_dropped_and_counted() -> None:
    line = Line()
    line.send(*(Samples(99, k, k, k, 0, b"") for k in range(WAITING + 7)))
    assert (line.assembler.undescribed, line.assembler.waiting) == (7, WAITING)


def test_a_burst_of_another_size_than_described_is_dropped_and_counted() -> None:
    line = Line()
    line.send(
        identity(),
        strip("index"),
        info("index"),
        replace(bursts("index", INDEX, info("index"))[0], data=bytes(11)),
    )
    assert line.blocks == []
    assert line.assembler.undescribed == 1


def test_lost_samples_are_counted_by_their_index_also_where_it_wraps() -> None:
    line = Line()
    sent = bursts("index", INDEX, info("index"), first=2**32 - 12)
    line.send(identity(), strip("index"), info("index"), *sent[:2], *sent[4:])
    assert line.assembler.counts["index"] == StreamCount(len(INDEX.t) - 10, lost=10, unsent=10)


def test_a_strip_may_be_pulled_and_plugged_in_again() -> None:
    line, sent = Line(), bursts("index", INDEX, info("index"))
    line.send(identity(), strip("index"), info("index"), *sent[:20])
    line.send(strip("index", attached=False))
    assert line.assembler.strips == {}
    assert line.assembler.streams == {}
    again = [replace(s, index=s.index - sent[30].index) for s in sent[30:]]
    line.send(strip("index"), info("index"), *again)
    got = line.of("index")
    kept = np.r_[0:100, 150:300]
    np.testing.assert_allclose(got.t, INDEX.t[kept], atol=2e-9)
    np.testing.assert_array_equal(got.values, as_float32(INDEX)[kept])
    assert line.assembler.counts["index"] == StreamCount(250)


def test_another_strip_at_the_connector_begins_another_stream_in_the_same_chunk_of_bytes() -> None:
    line = Line()
    short = replace(strip("index"), strip_id=5, points=("index_proximal", "index_distal"))
    two = Block(INDEX.stream, INDEX.t, INDEX.values[:, [0, 2]])
    sent, other = bursts("index", INDEX, info("index")), bursts("index", two, info("index"))
    got = line.send(
        identity(), strip("index"), info("index"), *sent[:10], short, info("index"), *other[10:]
    )
    assert [(b.stream.name, b.stream.sensors, len(b.t)) for b in got] == [
        ("index", strip("index").points, 50),
        ("index", short.points, 250),
    ]


def test_two_strips_of_the_same_finger_are_two_streams() -> None:
    line = Line()
    second, second_info = (
        replace(strip("index"), slot=9, strip_id=5),
        replace(info("index"), stream=77, slot=9),
    )
    line.send(identity(), strip("index"), info("index"), second, second_info)
    line.send(
        *bursts("index", INDEX, info("index"))[:4],
        *(replace(b, stream=77) for b in bursts("index", INDEX, info("index"))[:4]),
    )
    assert {b.stream.name: len(b.t) for b in line.blocks} == {"index": 20, "index_slot9": 20}


def test_the_magnetometer_of_a_strip_is_a_stream_of_its_own() -> None:
    line = Line()
    line.send(
        identity(),
        strip("index"),
        info("index"),
        replace(
            info("index"), stream=50, quantities=(MAG,), scale=(1.0,), full_scale=(0.0,), rate=20.0
        ),
    )
    assert {s.name: (s.quantities, s.full_scale) for s in line.assembler.streams.values()} == {
        "index": ((GYR, ACC), {GYR: 40.0, ACC: 160.0}),
        "index_mag": ((MAG,), {}),
    }


def test_after_a_restart_the_recordings_time_goes_on_with_the_hosts() -> None:
    line, sent = Line(), bursts("hand", HAND, info("hand"))
    line.send(identity(1), strip("hand"), info("hand"))
    for s in sent[:20]:
        line.send(s, at=100.0 + s.t_first / NS - ON)
    line.encoder = Encoder()
    line.send(identity(2), at=105.0)
    again = bursts("hand", HAND, info("hand"), on=0.5)
    line.send(again[0], at=105.2)  # comes before its strip is described: waits
    line.send(strip("hand"), info("hand"), at=105.3)
    for s in again[1:]:
        line.send(s, at=105.2 + s.t_first / NS - 0.5)
    t = line.of("hand").t
    np.testing.assert_allclose(t[:100], HAND.t[:100], atol=2e-9)
    np.testing.assert_allclose(
        t[100:], 5.2 + HAND.t, atol=1e-6
    )  # the first sample's arrival, not the identity's
    assert line.assembler.counts["hand"] == StreamCount(400)
    assert line.assembler.decoder.counters.lost == 0


def test_bursts_that_waited_before_a_restart_are_not_given_to_the_streams_after_it() -> None:
    line = Line()
    line.send(identity(1), *bursts("hand", HAND, info("hand"))[:3])
    line.encoder = Encoder()
    line.send(identity(2), strip("hand"), info("hand"))
    assert line.blocks == []
    assert line.assembler.undescribed == 3


@given(st.floats(-100e-6, 100e-6), st.integers(0, 2**32 - 1))
def test_a_foreign_clock_is_mapped_and_loses_no_sample(drift: float, seed: int) -> None:
    """A wireless sensor at 100 Hz: bursts of 4, sent on 5 ms and more late, 15 on average; from 10 s on within 2 ms of the least delay."""
    rng, n = np.random.default_rng(seed), 2000
    t = np.arange(n) / 100
    line, foreign = Line(), info("forearm", clock=3)
    line.send(
        identity(),
        strip("hand"),
        info("hand"),
        strip("forearm"),
        foreign,
        bursts("hand", HAND, info("hand"))[0],
    )
    for k in range(0, n, 4):
        own, sent = (
            round((3.0 + t[k] * (1 + drift)) * NS),
            round((ON + t[k] + 0.005 + rng.exponential(0.01)) * NS),
        )
        line.send(
            Samples(foreign.stream, k, own, sent, 4, np.full((4, 1, 6), k / n, "<f4").tobytes())
        )
    got = line.of("forearm")
    assert line.assembler.counts["forearm"] == StreamCount(n)
    np.testing.assert_array_equal(
        got.values[:, 0, 0], np.repeat(np.arange(0, n, 4) / n, 4).astype("<f4")
    )
    assert (np.diff(got.t) > 0).all()
    late = got.t[1000:] - t[1000:] - 0.005
    assert late.min() > -1.5e-3
    assert late.max() < 2e-3


def test_a_clock_that_jumps_back_loses_samples_and_says_so() -> None:
    line, sent = Line(), bursts("hand", HAND, info("hand"))
    line.send(identity(), strip("hand"), info("hand"), *sent[:20])
    back = [replace(s, t_first=s.t_first - round(0.5 * NS)) for s in sent[20:]]
    line.send(*back)
    got = line.of("hand")
    assert (np.diff(got.t) > 0).all()
    assert line.assembler.counts["hand"] == StreamCount(250, lost=50)


def test_marks_become_events_those_before_the_first_sample_too() -> None:
    line = Line()
    early = Mark(round((ON - 0.25) * NS), round(0.5 * NS), "rest", {})
    pose = Mark(
        round((ON + 2) * NS),
        round(3 * NS),
        "initial_pose",
        {"thumb_cmc_flexion_deg": "-45.5", "note": "x", "thumb_cmc_pronation_deg": "?"},
    )
    line.send(
        identity(), early, strip("hand"), info("hand"), *bursts("hand", HAND, info("hand")), pose
    )
    start = HAND.t[0]
    assert line.assembler.marks == [
        Event(pytest.approx(-0.25 - start, abs=1e-9), pytest.approx(0.5), "rest", {}),
        Event(
            pytest.approx(2 - start, abs=1e-9),
            pytest.approx(3.0),
            "initial_pose",
            {"thumb_cmc_flexion_deg": -45.5, "note": "x", "thumb_cmc_pronation_deg": "?"},
        ),
    ]


def test_the_nominal_mounting_is_what_the_strips_plugged_in_say() -> None:
    line, turned = Line(), quat.about(1, 0.3)
    line.send(identity(), strip("hand", mounting=[float(x) for x in turned.astype("<f4")]))
    np.testing.assert_allclose(line.assembler.mounting["hand"], turned, atol=1e-7)
    line.send(replace(strip("hand"), strip_id=6))
    np.testing.assert_array_equal(line.assembler.mounting["hand"], quat.IDENTITY)


def test_samples_at_the_limit_are_counted() -> None:
    block = Block(HAND.stream, HAND.t, HAND.values.copy())
    block.values[7, 0, 1], block.values[8, 0, 5], block.values[8, 0, 0] = 39.9, -159.0, 10.0
    line = _fed(whole_session({"hand": block}))
    assert line.assembler.counts["hand"].saturated == 2


def test_the_recordings_time_is_known_at_any_moment_of_the_hosts_clock() -> None:
    assembler = Assembler()
    assert assembler.recording_time(100.0) is None
    line = _fed(whole_session({"hand": HAND}, host=50.0))
    now = line.assembler.recording_time(60.0)
    assert now == pytest.approx(10.0 - HAND.t[0] - 0.002, abs=1e-6)


def test_a_pong_betters_the_hosts_map() -> None:
    line = _fed(whole_session({"hand": HAND}, host=50.0))
    before = line.assembler.recording_time(60.0)
    line.send(Pong(1, round((ON + HAND.t[-1] + 0.5) * NS)), at=50.0 + HAND.t[-1] + 0.5 + 0.0001)
    assert line.assembler.recording_time(60.0) == pytest.approx(before + 0.0019, abs=1e-6)


def test_answers_status_and_calibrations_are_kept() -> None:
    line = Line()
    told = [
        wire.Status(1, 2, 255, 30.0),
        wire.Reply(0x82, wire.ReplyCode.BUSY, "stop first"),
        wire.StripCalibration(2, 1),
    ]
    line.send(*told)
    assert line.assembler.status == told[0]
    assert list(line.assembler.replies) == [told[1]]
    assert line.assembler.calibrations == {(2, 1): told[2]}


def test_strips_exchanged_on_the_way_go_on_under_each_others_names_without_a_loss() -> None:
    samples = {name: in_strips("left").samples[name] for name in ("hand", "index", "ring")}
    sent = list(whole_session(samples, Format.FLOAT32))
    assembler, encoder = Assembler(), Encoder()
    found: dict[bool, dict[str, list[Block]]] = {False: {}, True: {}}
    for k, message in enumerate(sent):
        if k == len(sent) // 2:
            assembler.exchange({"index": "ring", "ring": "index"})
        for block in assembler.feed(encoder.frame(message.message), message.arrival):
            found[k >= len(sent) // 2].setdefault(block.stream.name, []).append(block)
    assert set(found[True]) == {"hand", "index", "ring"}
    assert {c.lost for c in assembler.counts.values()} == {0}
    for finger, other in (("index", "ring"), ("ring", "index")):
        values = np.concatenate(
            [b.values for half in ((False, finger), (True, other)) for b in found[half[0]][half[1]]]
        )
        np.testing.assert_array_equal(values, as_float32(samples[finger]))
        assert found[True][finger][0].stream.sensors == samples[finger].stream.sensors
    assembler.exchange({})
    assert {s.name for s in assembler.streams.values()} == {"hand", "index", "ring"}
    assert {p.split("_")[0] for strip in assembler.strips.values() for p in strip.points} == {
        "hand",
        "index",
        "ring",
    }
