"""The two hands."""

from typing import Literal

Hand = Literal["left", "right"]
HANDS: tuple[Hand, Hand] = ("left", "right")
