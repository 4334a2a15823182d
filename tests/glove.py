"""The bytes that a glove would send, for tests."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.numerics.typing import Array
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Format, Identity, Message, Samples, StreamInfo, Strip
from handscope.sessions.wire.sample_values import encode_values
from tests.simulated import STRIPS

NS = 1e9
SLOTS = {name: k for k, name in enumerate(STRIPS)}
ON = 7.25  # s, the base unit's clock when a recording begins


def identity(boot_id: int = 1, hand: Hand | None = "left") -> Identity:
    return Identity(0xC0FFEE, boot_id, hand, "Test glove", "2.1")


def strip(name: str, attached: bool = True, mounting: Sequence[float] = ()) -> Strip:
    return Strip(SLOTS[name], attached, 0xABC0 + SLOTS[name], STRIPS[name], tuple(mounting))


def info(
    name: str, rate: float = 100.0, kind: Format = Format.FLOAT32, clock: int = 0
) -> StreamInfo:
    scale = (1.0, 1.0) if kind is Format.FLOAT32 else (1 / 512, 1 / 128)
    return StreamInfo(
        10 + SLOTS[name], SLOTS[name], clock, (GYR, ACC), kind, rate, scale, (40.0, 160.0)
    )


def bursts(
    name: str, block: Block, described: StreamInfo, length: int = 5, on: float = ON, first: int = 0
) -> list[Samples]:
    """A strip's block in bursts on the base unit's clock; the last sample is sent on at once."""
    made = []
    for k in range(0, len(block.t), length):
        t, values = block.t[k : k + length], block.values[k : k + length]
        start, sent = round((on + t[0]) * NS), round((on + t[-1]) * NS)
        made.append(
            Samples(
                described.stream, first + k, start, sent, len(t), encode_values(values, described)
            )
        )
    return made


@dataclass(frozen=True)
class Sent:
    """A message and when its bytes arrive at the host, s."""

    message: Message
    arrival: float


def whole_session(
    samples: dict[str, Block],
    kind: Format = Format.FLOAT32,
    host: float = 100.0,
    hand: Hand = "left",
) -> list[Sent]:
    """Who and what the glove is, then all bursts in order of time."""
    infos = {name: info(name, b.stream.rate, kind) for name, b in samples.items()}
    told: list[Message] = [
        identity(hand=hand),
        *(m for name in samples for m in (strip(name), infos[name])),
    ]
    sent = [m for name, b in samples.items() for m in bursts(name, b, infos[name])]
    return [Sent(m, host) for m in told] + [
        Sent(m, host + m.t_sent / NS - ON + 0.002)
        for m in sorted(sent, key=lambda m: (m.t_sent, m.stream))
    ]


def frames(messages: Iterable[Message], encoder: Encoder | None = None) -> list[bytes]:
    encoder = encoder or Encoder()
    return [encoder.frame(m) for m in messages]


def as_float32(block: Block) -> Array:
    """The values after their way through FLOAT32."""
    return block.values.astype("<f4").astype(float)


def turned_off_and_on(message: Message, boot_id: int) -> Message:
    return replace(message, boot_id=boot_id) if isinstance(message, Identity) else message
