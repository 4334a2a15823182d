"""Conditions of the magnet's filter violated on purpose: what is marked doubtful, and what is wrong unsaid (0006-magnet-violated.md has the table).

python docs/decisions/0006-magnet-violated.py both 701 702 703 704
"""

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.sensors import magnetometer_ellipsoid
from handscope.estimators.simulation import magnet
from handscope.estimators.simulation.magnetic_field import EARTH, MagneticField, office
from handscope.validation.papers import kortier5

FAR = 1.2  # m of the dipole that makes a gradient
Change = Callable[[Setup, Readings, int], tuple[Setup, Readings]]


def gradient(size: float) -> Callable[[int], MagneticField]:
    """The office with a gradient of about `size` T/m at the trunk."""

    def room(seed: int) -> MagneticField:
        rng, o = np.random.default_rng([seed, 77]), office(np.random.default_rng([seed, 9]))
        toward, moment = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        strength = size * FAR**4 / 6e-7
        return MagneticField(
            o.earth,
            np.vstack([o.places, kortier5.SPOT + FAR * toward]),
            np.vstack([o.moments, strength * moment]),
        )

    return room


def near(
    place: tuple[float, float, float], moment: tuple[float, float, float], stream: int
) -> Callable[[int], MagneticField]:
    """A piece beside the trunk, not there while the plate was turned."""

    def piece(seed: int) -> MagneticField:
        at = (
            kortier5.SPOT
            + np.array(place)
            + 0.05 * np.random.default_rng([seed, stream]).normal(size=3)
        )
        return MagneticField(np.zeros(3), at[None], np.array(moment)[None])

    return piece


def read(change: Callable[[np.ndarray, np.ndarray, int], np.ndarray]) -> Change:
    return lambda setup, r, seed: (setup, replace(r, mag=change(r.mag.copy(), r.t, seed)))


def late(mag: np.ndarray, which: slice) -> np.ndarray:
    mag[6:, which] = mag[:-6, which].copy()
    return mag


def mirrored(mag: np.ndarray) -> np.ndarray:
    mag[:, 1, 2] *= -1
    return mag


def off(setup: Setup) -> Setup:
    places = setup.array.places.copy()
    places[2, 0] += 0.02
    return replace(setup, array=replace(setup.array, places=places))


ROOMS = {f"gradient {1e6 * g:g} uT/m": gradient(g) for g in (1e-6, 5e-6, 20e-6)}
PIECES = {
    "iron at 40 cm": near((-0.25, 0.2, -0.1), (0.05, 0.1, -0.4), 79),
    "second magnet in the room": lambda seed: near(
        (0.1, 0.4, -0.1), tuple(0.32 * np.eye(3)[seed % 3]), 78
    )(seed),
}
CHANGES: dict[str, Change] = {
    "as told": lambda setup, r, seed: (setup, r),
    "hum 2 uT": read(
        lambda mag, t, seed: (
            mag + 2e-6 * np.sin(2 * np.pi * 50 * t)[:, None, None] * np.array([0.6, 0.0, 0.8])
        )
    ),
    "axis mirrored": read(lambda mag, t, seed: mirrored(mag)),
    "one 0.1 s late": read(lambda mag, t, seed: late(mag, slice(1, 2))),
    "all 0.1 s late": read(lambda mag, t, seed: late(mag, slice(None))),
    "a place 2 cm off": lambda setup, r, seed: (off(setup), r),
    "moment 20 % off": lambda setup, r, seed: (
        replace(setup, magnet=replace(setup.magnet, moment=0.8 * setup.magnet.moment)),
        r,
    ),
}


def trial(movement: str, seed: int, case: str) -> tuple[float, float, float]:
    """RMS mm, share doubtful %, share wrong by 3 cm and three standard deviations and not doubtful %."""
    rng = np.random.default_rng([seed, 5])
    room = ROOMS[case](seed) if case in ROOMS else office(np.random.default_rng([seed, 9]))
    worn, spot = magnet.draw_worn(rng), kortier5.SPOT
    turning = magnet.rotate_plate(rng, spot=spot)
    raw = magnet.simulate_magnetic(worn, turning, room, rng, magnet=False)
    spheres = [
        magnetometer_ellipsoid.fit_ellipsoid(raw[:, k], strength=EARTH) for k in range(raw.shape[1])
    ]
    calibrated = np.stack([s.corrected(raw[:, k]) for k, s in enumerate(spheres)], axis=1)
    q_bl = magnetometer_ellipsoid.find_common_axes(calibrated).q_1l
    dip = magnetometer_ellipsoid.dip(
        calibrated[:, 0], magnet.simulate_inertial(worn, turning, rng)[:, 0, 3:]
    )
    m = magnet.simulate_condition(movement, rng, spot=spot)
    told = quat.multiply(m.q_bt[0], quat.exp(kortier5.START / np.sqrt(3) * rng.normal(size=3)))
    carried = magnet_setup.make_magnet(worn.declared_moment, worn.declared_lever)
    setup = Setup(
        magnet_setup.make_constellation(worn.declared_places, q_bl), carried, EARTH, dip, None, told
    )
    inertial = magnet.simulate_inertial(worn, m, rng)
    raw = magnet.simulate_magnetic(
        worn, m, room, rng, second=PIECES[case](seed) if case in PIECES else None
    )
    mag = np.stack([s.corrected(raw[:, k]) for k, s in enumerate(spheres)], axis=1)
    setup, readings = CHANGES.get(case, CHANGES["as told"])(
        setup, Readings(m.t, inertial[:, 0], inertial[:, 1], mag), seed
    )
    track = magnet_tracker.track_readings(MagnetParams(gyr_reading="instant"), setup, readings)
    late_on = m.t >= kortier5.FIRST
    wrong, sd = (
        np.linalg.norm(track.p_bt - m.p_bt, axis=1)[late_on],
        np.linalg.norm(track.p_sd, axis=1)[late_on],
    )
    doubtful = track.doubtful[late_on]
    unsaid = ~doubtful & (wrong > 0.03) & (wrong > 3 * sd)
    return (
        1e3 * float(np.sqrt((wrong**2).mean())),
        100 * float(doubtful.mean()),
        100 * float(unsaid.mean()),
    )


if __name__ == "__main__":
    for case in (*CHANGES, *ROOMS, *PIECES):
        rms, doubtful, unsaid = np.mean(
            [trial(sys.argv[1], int(seed), case) for seed in sys.argv[2:]], axis=0
        )
        print(  # noqa: T201
            f"{case:28s} {rms:7.1f} mm   doubtful {doubtful:5.1f} %   wrong unsaid {unsaid:5.1f} %",
            flush=True,
        )
