"""What places that touch say of each other, as linear equations with noise: the same for every kind of contact.

In      which contacts were held, their places (k, 3) in the hand's frame, the vertical in it, how exactly people touch
Out     residuals that would be zero, their derivatives by the places and by the vertical, their noise
Source  closed chains as of Salchow-Hoemmen 2019, 3.2, P1 to P4; sizes are options
Limits  of a table only that it is flat and nearly level: how high it is is not known
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.held_contact import PALM, TABLE, HeldContact, Place
from handscope.estimators.data.options import option
from handscope.estimators.hand.anatomy import Hand, side_sign
from handscope.estimators.numerics.typing import Array

EARLY, LATE = 0.4, 0.75  # shares of a hold: fingers have come to rest; what is held is used
STILL = np.radians(4.0)  # most that a joint turns between the two: tremor, and what a filter learns
LASTING = 0.6  # of a contact's variance: the same each time, as how thick a pulp is and where its owner touches; ours


@dataclass(frozen=True, kw_only=True)
class ContactParams:
    """Options of contacts that are held for calibration."""

    contact_sd: float = option(
        0.005,
        "m",
        "where on their pads two fingertips touch that are held together for calibration, each axis; 0: no contacts are used",
        "ours: a third of a pad's width; docs/decisions/0019-contacts.md",
    )
    mark_sd: float = option(
        0.004,
        "m",
        "where a mark on the palm's crease lies against the MCP joint of the finger that it is in line with, each axis; 0: contacts with it are not used",
        "6.8 to 10.3 mm from the joints: Bugbee & Botte 1993, Clin Orthop 296:122; how well it is found and how thick skin is: ours",
    )
    pulp_sd: float = option(
        0.002,
        "m",
        "how far the pulp of a fingertip on a table reaches below what the model has; 0: contacts with a table are not used",
        "ours: thicknesses of fingertips scatter by 1 to 2 mm, a pulp gives by as much",
    )
    table_tilt: float = option(
        1.0,
        "deg",
        "tilt of a table about each axis",
        "ours: 1 deg lifts one end of a table of 1 m by 17 mm",
        least=0.01,
    )


@dataclass(frozen=True)
class Constraint:
    """m equations between k places."""

    residual: Array  # (m,) m, zero where the contact is as asked
    by_places: Array  # (k, m, 3)
    by_vertical: Array  # (k, m, 3) m, by the vertical as each place's chain has it
    noise: Array  # (m, m) m^2, of where people touch
    missed: float  # m, how far the farthest place is from it


def kind_sd(params: ContactParams, held: HeldContact) -> float:
    """How exactly its places are known, m; 0 where such contacts are not to be used."""
    if not params.contact_sd > 0:
        return 0.0
    if held.on_table:
        return params.pulp_sd
    return params.mark_sd if held.contacts[0].b[0] == PALM else params.contact_sd


def places_of(held: HeldContact) -> tuple[Place, ...]:
    """The places that a contact is between; of a table the fingertips."""
    contacts = held.contacts
    return tuple(c.a for c in contacts) if held.on_table else (contacts[0].a, contacts[0].b)


def pulp_direction(held: HeldContact, vertical: Array, hand: Hand) -> Array:
    """Where a pulp that touches a table or the palm meets it, (3,) in the hand's frame as `vertical`."""
    if held.contacts[0].b == TABLE:
        return -vertical
    return np.array([side_sign(hand), 0.0, 0.0])


def growth(times: int) -> float:
    """By what the noise of a contact grows that was used `times` before: what all together tell of it never exceeds what lasts."""
    if not times:
        return 1.0
    tell = [1 / (LASTING + (1 - LASTING) / k) for k in (times, times + 1)]
    return 1 / (tell[1] - tell[0])


def between_two(
    params: ContactParams, places: Array, held: HeldContact, times: int = 0
) -> Constraint:
    """Two places (2, 3) that touch, or of which the distance (m) is known; held so `times` before."""
    distance = held.contacts[0].distance
    variance = params.contact_sd**2
    if held.contacts[0].b[0] == PALM:
        variance += params.mark_sd**2
    difference = places[0] - places[1]
    size = float(np.linalg.norm(difference))
    along = difference[None] / size if distance else np.eye(3)
    residual = np.array([size - distance]) if distance else difference
    return Constraint(
        residual,
        np.stack([along, -along]),
        np.zeros((2, len(along), 3)),
        growth(times) * variance * np.eye(len(along)),
        float(np.linalg.norm(residual)),
    )


def on_a_plane(params: ContactParams, places: Array, vertical: Array, times: int = 0) -> Constraint:
    """Places (k, 3) on a table of unknown height, with the vertical (k, 3) as each place's chain has it; held so `times` before."""
    heights = (places * vertical).sum(axis=1)
    off = heights - heights.mean()
    differences = _contrasts(len(places))  # (k - 1, k)
    # a tilt about a horizontal axis lifts places by what they lie beside each other
    up = vertical.mean(axis=0)
    level = places - places.mean(axis=0)
    level = level - np.outer(level @ up, up) / (up @ up)
    noise = params.pulp_sd**2 * np.eye(len(places))
    noise += np.radians(params.table_tilt) ** 2 * level @ level.T
    return Constraint(
        differences @ off,
        differences.T[:, :, None] * vertical[:, None, :],
        differences.T[:, :, None] * places[:, None, :],
        growth(times) * differences @ noise @ differences.T,
        float(np.abs(off).max()),
    )


def _contrasts(count: int) -> Array:
    """Orthonormal rows (count - 1, count) that a common height does not change."""
    basis = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))[0]
    return np.asarray(basis[:, 1:].T)
