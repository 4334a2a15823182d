"""State of the worn glove for a station's tick: samples, movement, and whether it is the right one."""

import time

from handscope.app.devices.glove import Glove
from handscope.app.live.readouts.bending_finger import bending_finger
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.machine import StationStatus
from handscope.estimators.hand.anatomy import SEGMENT, Hand
from handscope.estimators.messages.sentence import phrase

SILENCE = 0.5  # s without a sample
UNKNOWN = StationStatus(0.0, float("-inf"), False, 0.0, "", frozenset())  # before the first tick


def read_status(glove: Glove, tracking: Tracking, hand: Hand) -> StationStatus:
    """The status at this moment; it looks at the last second of every sensor."""
    motion = tracking.motion()
    newest = tracking.newest_sample()
    now = glove.now()
    recent = {s: m for s, m in motion.items() if m.seen > newest - SILENCE and s in SEGMENT}
    fastest = max(recent, key=lambda s: recent[s].rate, default="")
    is_flowing = (
        bool(recent)
        and now is not None
        and now - newest < SILENCE
        and not wrong_hand_sentence(glove, hand)
    )
    # force sensors and magnetometers
    points = {p for s in glove.assembler.streams.values() for p in s.sensors if p not in SEGMENT}
    return StationStatus(
        now=time.monotonic(),
        t=newest,
        flowing=is_flowing,
        angular_rate_peak=recent[fastest].rate if fastest else 0.0,
        fastest_segment=fastest,
        measured=frozenset(recent) | points,
        bends=bending_finger(recent),
        is_recording=glove.state.state != "recording_failed",
    )


def problem_sentence(glove: Glove, hand: Hand, calibrated: int) -> str:
    """Why this glove cannot be used; empty where it can."""
    return (
        foreign_bytes_sentence(glove)
        or wrong_hand_sentence(glove, hand)
        or other_glove_sentence(glove, calibrated)
    )


def foreign_bytes_sentence(glove: Glove) -> str:
    """Whether something else than a glove is at the port; empty where not."""
    if not glove.is_foreign:
        return ""
    return phrase("live.no_glove")


def wrong_hand_sentence(glove: Glove, hand: Hand) -> str:
    """Why the glove does not fit the session; empty where it does."""
    identity = glove.assembler.identity
    if identity is not None and identity.hand is not None and identity.hand != hand:
        return phrase("live.wrong_hand", one=identity.hand, other=hand)
    return ""


def other_glove_sentence(glove: Glove, calibrated: int) -> str:
    """Whether another glove was plugged in since glove number `calibrated` was calibrated; empty where not."""
    if glove.assembler.replaced == calibrated:
        return ""
    return phrase("live.other_glove")
