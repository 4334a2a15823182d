"""Which finger bends while the others rest, from how fast every sensor turns."""

from collections.abc import Mapping

from handscope.app.live.readouts.motion import Motion
from handscope.estimators.hand.anatomy import CHAINS, FINGERS

MOVES = 0.6  # rad/s at which a segment is lit while sensors are checked
ALONE = 2.0  # times as fast as every other finger moves the one that bends alone


def bending_finger(motion: Mapping[str, Motion]) -> str:
    """The finger that moves clearly faster than any other and the hand; empty where none does."""
    rates = {
        f: max((motion[s].rate for s in CHAINS[f] if s in motion), default=0.0) for f in FINGERS
    }
    rates["hand"] = motion["hand"].rate if "hand" in motion else 0.0
    first, second = sorted(rates, key=lambda f: rates[f], reverse=True)[:2]
    return first if first in FINGERS and rates[first] > max(MOVES, ALONE * rates[second]) else ""
