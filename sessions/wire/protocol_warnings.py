"""What a glove sent that the protocol does not allow, and what was lost between its sensors and the host, as sentences."""

from collections import defaultdict
from collections.abc import Iterator

from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.messages import VERSION


def protocol_warnings(assembler: Assembler) -> Iterator[str]:
    """A sentence each; none where the glove keeps to docs/wire-protocol.md and everything came."""
    yield from _lost_frames(assembler)
    yield from deviations(assembler)
    for name, count in assembler.counts.items():
        if count.lost:
            yield f"stream {name}: {count.lost} of {count.samples + count.lost} samples were lost"


def deviations(assembler: Assembler) -> Iterator[str]:
    """What the glove does that the protocol does not allow, losses on the wire aside; a sentence each."""
    identity = assembler.identity
    if identity is not None and identity.version != VERSION:
        yield f"the glove speaks version {identity.version} of the wire protocol, this program version {VERSION}: what it does not know is kept and not shown; use firmware of version {VERSION} or a newer program"
    yield from _refused(assembler)
    yield from _strips(assembler)
    for name, count in assembler.counts.items():
        if count.unsent:
            yield f"stream {name}: {count.unsent} samples were lost inside the glove, before they were sent"


def _lost_frames(assembler: Assembler) -> Iterator[str]:
    counters, lost = assembler.counters, assembler.frame_losses
    if lost.glove:
        yield f"the glove dropped {lost.glove} frames because this machine did not take them"
    if lost.wire or counters.corrupt:
        yield f"on the wire {lost.wire} frames were lost and {counters.corrupt} damaged, of {counters.frames + lost.total}"
    if lost.open:
        yield f"{lost.open} frames are missing since the glove's last status: whether glove or wire lost them is not known"


def _refused(assembler: Assembler) -> Iterator[str]:
    if count := assembler.counters.malformed:
        yield f"{count} messages of the glove were left out ({assembler.decoder.refusal}); correct its firmware"
    if dropped := assembler.undescribed + assembler.waiting:
        yield f"{dropped} bursts of samples were left out: the glove never said what they are"


def _strips(assembler: Assembler) -> Iterator[str]:
    for slot, ids in sorted(assembler.contested.items()):
        yield f"slot {slot} was claimed by strips {ids}: the newest has it; plug only one of them in, or give one another slot"
    slots: dict[str, list[int]] = defaultdict(list)
    for slot, strip in sorted(assembler.strips.items()):
        for point in strip.points:
            slots[point].append(slot)
    for many in sorted({tuple(s) for s in slots.values() if len(s) > 1}):
        points = ", ".join(p for p, s in slots.items() if tuple(s) == many)
        yield f"slots {', '.join(map(str, many))} state the same place ({points}); unplug all but one"
