"""Fingers by name, as messages say them."""

from handscope.estimators.messages.sentence import phrase

FINGER_WORDS = {
    "thumb": phrase("finger.thumb"),
    "index": phrase("finger.index"),
    "middle": phrase("finger.middle"),
    "ring": phrase("finger.ring"),
    "little": phrase("finger.little"),
}
