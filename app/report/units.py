"""Units a person reads: degrees and millimetres instead of SI, percent for shares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.app.language import Language
from handscope.estimators.measures.figure import Figure

DEG = 57.29577951308232  # of a rad
READABLE = {
    "rad": ("deg", DEG),
    "rad/s": ("deg/s", DEG),
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "T": ("uT", 1e6),
    "m^3": ("l", 1e3),
    "N/m": ("N/mm", 1e-3),
    "m/N": ("mm/N", 1e3),
    "Nm": ("mNm", 1e3),
}
SHARES = ("_cv", "_ratio", "_share")  # figures of unit 1 that are read in percent

PACE = ("slower", "faster")  # of fatigue: the first intervals less the last
DIRECTIONS = {  # of figures that are changes themselves
    "_fatigue": PACE,
    "_interval_slope": ("shorter", "longer"),
    "_decrement_": ("smaller", "larger"),
}
TAPPING_ROWS = (  # figures of tapping that have a row, in order
    "tapping_count",
    "tapping_rate",
    "tapping_interval_mean",
    "tapping_interval_cv",
    "tapping_amplitude_mean",
    "tapping_amplitude_cv",
    "tapping_opening_speed_mean",
    "tapping_closing_speed_mean",
    "tapping_decrement_slope",
    "tapping_decrement_ratio",
    "tapping_fatigue50",
    "tapping_angle_amplitude_mean",
    "tapping_interruptions",
    "tapping_freezes",
    "tapping_longest_stop",
)


BROKEN = 0.5  # what `places_of` is asked with for all values of a figure that may be broken
DECIMALS = {"deg": 0, "deg/s": 0, "per s": 2, "s": 3, "%": 1, "mm": 1, "mm/s": 0, "": 1}
MOST_DECIMALS = {"deg": 0, "%": 0, "mm": 0, "mm/s": 0, "deg/s": 0, "Hz": 2, "per s": 2, "s": 2}


@dataclass(frozen=True)
class Reading:
    """A figure's value as it is read; NaN where it was not measured."""

    value: float
    unit: str  # "" for a count


def reading(figure: Figure) -> Reading:
    """The figure in the unit a person reads."""
    if figure.unit == "1":
        return (
            Reading(100 * figure.value, "%")
            if figure.name.endswith(SHARES)
            else Reading(figure.value, "")
        )
    unit, factor = READABLE.get(figure.unit, (figure.unit, 1.0))
    return Reading(factor * figure.value, unit)


def unit_words(unit: str, language: Language) -> str:
    """The unit as printed: "per s" for Hz."""
    return language.known(f"unit.{unit}", unit)


def with_unit(number: str, unit: str, language: Language) -> str:
    """A number with its unit as printed: "27°", "2.50 per s"."""
    words = unit_words(unit, language)
    return f"{number}{words}" if words.startswith("°") else f"{number} {words}".strip()


def signed(name: str, value: float, places: int, unit: str, language: Language) -> str:
    """A figure's number with its unit and so many decimals; its sign is said in words."""
    size = with_unit(language.number(abs(value), places), unit, language)
    return directed(name, value, size, language) if round(abs(value), places) else size


def directed(name: str, value: float, size: str, language: Language) -> str:
    """A size with the direction that the sign of a figure's value, not zero, stands for: "0.05 s slower"; of most figures one above zero has none."""
    below, above = directions_of(name)
    direction = below if value < 0 else above
    return language.say(f"direction.{direction}", size=size) if direction else size


def directions_of(name: str) -> tuple[str, str]:
    """What values of a figure below and above zero are."""
    return next(
        (directions for part, directions in DIRECTIONS.items() if part in name), ("smaller", "")
    )


def places_of(name: str, value: float, unit: str) -> int:
    """Decimals of a figure by its name and unit: the same in a tile, a course, a change and a goal, whatever the size; of a count none, but of a mean of several."""
    if name.endswith("_slope"):
        return 2
    if name.endswith("_share") or (not unit and value == round(value)):
        return 0
    return DECIMALS.get(unit, 2)


def significant_places(value: float, unit: str) -> int:
    """Decimals that a person can use in a table of all figures: of 2.5 taps per second two, of 81 degrees none, of 8 degrees one."""
    most = MOST_DECIMALS.get(unit, 3)
    return min(decimals(value), most + (abs(value) < 10 and most == 0))


def deviation_words(trials: Sequence[Figure], language: Language) -> str:
    """ "± 0.9°": the standard deviation of a figure's value where it is of one trial; "" where it is not known."""
    figure, *others = trials
    sd = 0.0 if others or figure.sd is None else figure.sd
    read = reading(Figure(figure.name, sd, figure.unit, ""))
    if not (np.isfinite(read.value) and read.value > 0):
        return ""
    number = language.number(read.value, decimals_of_sd(read.value))
    return f"± {with_unit(number, read.unit, language)}"


def decimals_of_sd(sd: float) -> int:
    """Decimals of a value with such a deviation, of which two digits are said."""
    return max(0, min(3, 1 - int(np.floor(np.log10(sd)))))


def decimals(value: float) -> int:
    """So that about three figures are seen."""
    return max(0, min(3, 2 - int(np.floor(np.log10(abs(value)))))) if value else 0
