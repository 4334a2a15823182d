"""The payload of the message that declares where magnetometers sit on the trunk and which magnet sits on the hand."""

import struct

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import TRACKED_POINTS


def write_plate(m: Plate) -> bytes:
    """The payload of a declared plate of magnetometers."""
    dip = float("nan") if m.dip is None else m.dip
    head = struct.pack("<8fB", m.earth, dip, *m.moment, *m.place, len(m.places))
    return head + b"".join(
        struct.pack("<B3f", TRACKED_POINTS.index(name), *p) for name, p in m.places.items()
    )


def read_plate(p: bytes) -> Plate:
    """The plate; ValueError, IndexError or struct.error where the bytes make none."""
    earth, dip, *numbers, count = struct.unpack_from("<8fB", p)
    rows = [struct.unpack_from("<B3f", p, 33 + 13 * k) for k in range(count)]
    places = {TRACKED_POINTS[code]: (x, y, z) for code, x, y, z in rows}
    if not np.isfinite(
        [earth, *numbers, *(x for place in places.values() for x in place)]
    ).all() or np.isinf(dip):
        raise ValueError("a plate of numbers that are not finite")
    if len(places) < count:
        raise ValueError("a magnetometer told twice")
    a, b = tuple(numbers[:3]), tuple(numbers[3:])
    return Plate(
        places, (a[0], a[1], a[2]), (b[0], b[1], b[2]), earth, None if np.isnan(dip) else dip
    )
