"""What is said of a glove that breaks the protocol, or of which not everything came: the right side is named, the rest goes on."""

from dataclasses import replace

import pytest

from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.frame_losses import FrameLosses, LossAttribution
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Message
from handscope.sessions.wire.protocol_warnings import protocol_warnings
from tests.glove import bursts, identity, info, strip
from tests.simulated import cut, in_strips

INDEX = cut(in_strips("left").samples["index"], [100])[0]
BURSTS = bursts("index", INDEX, info("index"))  # 20 of 5 samples
GREETING = (identity(), strip("index"), info("index"))


def status(overruns: int) -> wire.Status:
    return wire.Status(0, overruns, 255, 30.0)


class Host:
    """An assembler at the end of a wire that loses what it is asked to lose."""

    def __init__(self, *messages: Message) -> None:
        self.assembler, self._encoder = Assembler(), Encoder()
        self.send(*messages)

    def send(self, *messages: Message, lost: bool = False) -> None:
        for message in messages:
            frame = self._encoder.frame(message)
            self.assembler.feed(b"" if lost else frame, 100.0)

    def warnings(self) -> list[str]:
        return list(protocol_warnings(self.assembler))


def test_nothing_is_said_of_a_glove_that_is_well() -> None:
    assert Host(*GREETING, status(0), *BURSTS, status(0)).warnings() == []


def test_frames_that_the_glove_dropped_are_not_the_wires() -> None:
    host = Host(*GREETING, status(3), *BURSTS[:4])  # 3 before anybody listened
    host.send(*BURSTS[4:6], lost=True)
    host.send(*BURSTS[6:9], status(5), *BURSTS[9:11])
    host.send(BURSTS[11], lost=True)
    host.send(BURSTS[12])
    assert host.assembler.frame_losses == FrameLosses(glove=2, wire=0, open=1)
    host.send(status(5))
    assert host.assembler.frame_losses == FrameLosses(glove=2, wire=1)
    assert host.warnings() == [
        "the glove dropped 2 frames because this machine did not take them",
        "on the wire frames were lost (1) or damaged (0), of 19",
        "stream index: lost samples: 15 of 65",
    ]


def test_a_glove_that_begins_again_counts_its_drops_anew() -> None:
    attribution = LossAttribution()
    for overruns, missing in ((7, 0), (9, 2), (1, 4)):
        attribution.update(overruns, missing)
    assert attribution.losses(5) == FrameLosses(glove=3, wire=1, open=1)


def test_samples_that_the_glove_never_sent_are_named_so() -> None:
    host = Host(*GREETING, *BURSTS[:4], *BURSTS[6:], status(0))
    assert host.warnings()[0] == (
        "stream index: 10 samples were lost inside the glove, before they were sent"
    )


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        (replace(identity(), version=2), "speaks version 2 of the wire protocol"),
        (replace(info("hand"), rate=0.0), "stream 10 states 0 Hz"),
        (replace(info("hand"), rate=1e9), "stream 10 states 1e+09 Hz"),
        (replace(strip("index"), strip_id=7), "slot 2 was claimed by strips abc2 and 7"),
        (replace(strip("index"), slot=40), "slots 2, 40 state the same place"),
    ],
)
def test_what_is_not_allowed_is_a_sentence_and_the_rest_goes_on(
    sent: Message, sentence: str
) -> None:
    host = Host(*GREETING, *BURSTS[:10])
    host.send(sent, *BURSTS[10:])
    assert any(sentence in warning for warning in host.warnings())
    assert host.assembler.counts["index"].samples == 100


def test_64_strips_are_read_and_the_double_ones_named() -> None:
    host = Host(*GREETING)
    for slot in range(64):
        host.send(
            replace(strip("index"), slot=slot, strip_id=slot),
            replace(info("index"), slot=slot, stream=100 + slot),
        )
    for slot in range(64):
        host.send(*(replace(b, stream=100 + slot) for b in BURSTS[:2]))
    counts = host.assembler.counts
    assert len(counts) == 64 and {c.samples for c in counts.values()} == {10}
    assert any("state the same place" in warning for warning in host.warnings())
