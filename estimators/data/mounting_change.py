"""A sensor that turned on its segment while the hand moved."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MountingChange:
    """A sensor that has turned on its segment; of several segments one, the movement does not tell which."""

    segments: tuple[str, ...]  # the likeliest first
    start: float  # s, when it turned, to a block of the method
    noticed: float  # s
    turn: float  # rad, as far as the joints show it
    p_value: float  # expected number of such findings in an hour if no sensor had turned
