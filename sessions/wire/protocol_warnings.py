"""What a glove sent that the protocol does not allow, and what was lost between its sensors and the host, as sentences."""

from collections import defaultdict
from collections.abc import Iterator

from handscope.estimators.messages.sentence import phrase
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.messages import VERSION


def protocol_warnings(assembler: Assembler) -> Iterator[str]:
    """A sentence each; none where the glove keeps to docs/wire-protocol.md and everything came."""
    yield from _lost_frames(assembler)
    yield from deviations(assembler)
    for name, count in assembler.counts.items():
        if count.lost:
            yield phrase(
                "wire.samples_lost", stream=name, lost=count.lost, all=count.samples + count.lost
            )


def deviations(assembler: Assembler) -> Iterator[str]:
    """What the glove does that the protocol does not allow, losses on the wire aside; a sentence each."""
    identity = assembler.identity
    if identity is not None and identity.version != VERSION:
        yield phrase("wire.other_version", theirs=identity.version, ours=VERSION, needed=VERSION)
    yield from _describe_dropped(assembler)
    yield from _strips(assembler)
    for name, count in assembler.counts.items():
        if count.unsent:
            yield phrase("wire.samples_lost_in_glove", stream=name, count=count.unsent)


def _lost_frames(assembler: Assembler) -> Iterator[str]:
    counters, lost = assembler.counters, assembler.frame_losses
    if lost.glove:
        yield phrase("wire.frames_dropped", count=lost.glove)
    if lost.wire or counters.corrupt:
        yield phrase(
            "wire.frames_lost",
            lost=lost.wire,
            corrupt=counters.corrupt,
            all=counters.frames + lost.total,
        )
    if lost.open:
        yield phrase("wire.frames_missing", count=lost.open)


def _describe_dropped(assembler: Assembler) -> Iterator[str]:
    if count := assembler.counters.malformed:
        yield phrase("wire.messages_refused", count=count, reason=assembler.decoder.refusal)
    if dropped := assembler.undescribed + assembler.waiting:
        yield phrase("wire.undescribed_samples", count=dropped)


def _strips(assembler: Assembler) -> Iterator[str]:
    for slot, ids in sorted(assembler.contested.items()):
        yield phrase("wire.slot_claimed_twice", slot=slot, ids=ids)
    slots: dict[str, list[int]] = defaultdict(list)
    for slot, strip in sorted(assembler.strips.items()):
        for point in strip.points:
            slots[point].append(slot)
    for many in sorted({tuple(s) for s in slots.values() if len(s) > 1}):
        points = ", ".join(p for p, s in slots.items() if tuple(s) == many)
        yield phrase("wire.same_place", slots=", ".join(map(str, many)), points=points)
