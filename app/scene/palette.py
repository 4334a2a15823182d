"""Colours of the scene, sRGB 0-255; ghost, highlight and unmeasured parts differ in lightness, for every colour vision.

Source  accents from Okabe & Ito 2008, Color Universal Design
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Paint:
    """What a part of the hand looks like; no opacity means solid."""

    colour: Colour
    opacity: float | None = None
    shaded: bool = True  # casts and takes shadows; thin plates would shade themselves in spots


SKIN = Paint((222, 164, 132))
NAIL = Paint((238, 192, 174), shaded=False)
UNFOLLOWED = Paint((172, 178, 186))  # as much as inclinations tell
UNFOLLOWED_NAIL = Paint((194, 199, 205), shaded=False)
CUFF = Paint((84, 96, 110))
UNMEASURED = Paint((158, 166, 176), 0.42)
GHOST = Paint((0, 114, 178), 0.34)
HIGHLIGHT = Paint((0, 92, 175))
GROUND: Colour = (206, 212, 218)
GROUND_SECTION: Colour = (184, 192, 200)
DARK_GROUND: Colour = (68, 82, 96)  # both in the dark theme
LABEL: Colour = (23, 31, 39)  # in the dark theme, behind a number
LABEL_INK: Colour = (233, 238, 243)
DIMMED = 0.8  # of the light, in the dark theme
SHADOW = 0.4  # of the contact shadow's opacity, in the light theme
TRAIL: Colour = (0, 114, 178)
FORCE: Colour = (176, 26, 4)
MEASURED: Colour = (0, 88, 176)  # these two are lit: darker than they look
TARGET: Colour = (0, 128, 92)
FADED: Colour = (222, 228, 234)


def trail(pieces: int) -> NDArray[np.uint8]:
    """Colours (pieces, 2, 3) of a line that fades towards its old end."""
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    colours = np.rint((1 - share) * np.array(FADED) + share * np.array(TRAIL)).astype(np.uint8)
    return np.stack([colours[:-1], colours[1:]], axis=1)
