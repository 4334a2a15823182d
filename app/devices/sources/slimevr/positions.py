"""Where a SlimeVR sensor sits, by the number that its firmware gives: hand and segment.

Source  SlimeVR-Tracker-ESP, src/sensors/sensorposition.h
"""

from handscope.estimators.hand.anatomy import CHAINS, FINGERS, HANDS, Hand

FOREARMS, PALMS, PHALANGES = (13, 14), (17, 18), (21, 36)  # left, right


def _places() -> dict[int, tuple[Hand, str]]:
    found: dict[int, tuple[Hand, str]] = {}
    for hand, forearm, palm, first in zip(HANDS, FOREARMS, PALMS, PHALANGES):
        found[forearm], found[palm] = (hand, "forearm"), (hand, "hand")
        segments = [segment for finger in FINGERS for segment in CHAINS[finger]]
        found |= {first + k: (hand, segment) for k, segment in enumerate(segments)}
    return found


PLACES = _places()
