"""The hand that a port's description names, before its glove says so itself."""

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, Hand


def named_hand(description: str) -> Hand | None:
    """The hand that a port's description names; None where it names none or both."""
    named = [hand for hand in HANDS if hand in description.split()]
    return named[0] if len(named) == 1 else None


def require_hand(description: str, hand: Hand) -> None:
    """Refuse a glove that is known to be of the other hand before anything of it is recorded. Raises InputError."""
    if (glove := named_hand(description)) not in (None, hand):
        raise InputError("device.glove_of_other_hand", glove=glove, hand=hand)
