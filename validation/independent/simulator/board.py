"""A board of magnetometer chips before which a magnet moves: fields, chips with iron and turns of their own, what can be wrong, and the tables that come of it.

Frames  the board's; a chip's own axes are turned against it
Units   m, T, A m^2
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.validation.independent.simulator.hand import Values

EARTH = np.array([18e-6, 5e-6, -45e-6])  # T
MU0_OVER_4PI = 1e-7  # T m / A
COUNT = 0.0146e-6  # T per LSB


def grid(along: int, pitch: float) -> Values:
    """A square of chips."""
    places = (np.arange(along) - (along - 1) / 2) * pitch
    return np.array([[x, y, 0.0] for y in places for x in places])


BOARDS: Mapping[int, Values] = {
    3: np.array([[-0.05, -0.03, 0], [0.05, -0.03, 0], [0, 0.06, 0]]),
    4: grid(2, 0.08),
    5: np.concatenate([grid(2, 0.16), np.zeros((1, 3))]),
    9: grid(3, 0.05),
    16: grid(4, 0.04),
}


@dataclass(frozen=True, kw_only=True)
class Chips:
    """Sizes of errors are standard deviations of every axis."""

    hard: float = 20e-6  # T of the board's iron
    soft: float = 0.03
    gain: float = 0.0  # share by which gains changed since the board was turned
    misplaced: float = 0.0  # m by which each chip sits elsewhere than declared
    noise: float = 0.2e-6  # T
    turned: bool = True  # mounted at random multiples of 90 deg
    misaligned: float = 0.0  # rad rms about each axis, soldering misalignment
    limit: float = np.inf  # T


@dataclass(frozen=True)
class Board:
    """Chips as they are."""

    chips: Chips
    declared: Values  # (n, 3) m, places
    places: Values  # (n, 3) m, where they are
    axes: Values  # (n, 3, 3) from the board's axes to the chip's, soft iron in it
    hard: Values  # (n, 3) T
    gains: Values  # (n, 3) since the board was turned


def draw_board(many: int, chips: Chips, rng: np.random.Generator) -> Board:
    """A board of so many chips, drawn at random; m, T."""
    declared = BOARDS[many]
    soft = chips.soft * rng.normal(size=(many, 3, 3))
    quarters = Rotation.from_euler(
        "xz",
        np.column_stack([180 * rng.integers(2, size=many), 90 * rng.integers(4, size=many)]),
        degrees=True,
    )
    axes = quarters.as_matrix() if chips.turned else np.repeat(np.eye(3)[None], many, axis=0)
    # `--turned` takes the frame of the board from the first chip as it was declared
    axes[0] = np.eye(3)
    axes = (np.eye(3) + (soft + soft.transpose(0, 2, 1)) / 2) @ axes
    if chips.misaligned:
        axes = (
            axes @ Rotation.from_rotvec(chips.misaligned * rng.normal(size=(many, 3))).as_matrix()
        )
    places, hard = (
        declared + chips.misplaced * rng.normal(size=(many, 3)),
        chips.hard * rng.normal(size=(many, 3)),
    )
    return Board(chips, declared, places, axes, hard, 1 + chips.gain * rng.normal(size=(many, 3)))


def read_fields(
    board: Board, B: Values, rng: np.random.Generator, after_calibration: bool = True
) -> Values:
    """Readings (n, chips, 3) in T of fields at the chips; `after_calibration`: gains changed since the board was turned."""
    y = (
        np.einsum("kij,nkj->nki", board.axes, B) * (board.gains if after_calibration else 1.0)
        + board.hard
    )
    y = np.clip(
        y + board.chips.noise * rng.normal(size=y.shape), -board.chips.limit, board.chips.limit
    )
    return np.asarray(np.round(y / COUNT) * COUNT)


def turn_board(
    board: Board, seconds: float, rate: float, rng: np.random.Generator
) -> tuple[Values, Values]:
    """Times and fields (n, chips, 3) while the board is turned by hand where the field is the same everywhere."""
    t, rotation, n = (
        np.arange(int(seconds * rate)) / rate,
        by_hand(seconds, rate, 2.2, rng),
        len(board.places),
    )
    return t, np.repeat(rotation.inv().apply(EARTH)[:, None], n, axis=1)


def by_hand(seconds: float, rate: float, swing: float, rng: np.random.Generator) -> Rotation:
    """How a board is turned by hand against the room (n,), begun straight; `swing` rad/s."""
    t = np.arange(int(seconds * rate)) / rate
    size, frequency, phase = (
        rng.uniform(-1, 1, (4, 3)),
        rng.uniform(0.05, 0.3, (4, 3)),
        rng.uniform(0, 2 * np.pi, (4, 3)),
    )
    rates = swing * (size * np.sin(2 * np.pi * frequency * t[:, None, None] + phase)).sum(axis=1)
    steps, out = Rotation.from_rotvec(rates / rate), [Rotation.identity()]
    for step in steps[1:]:
        out.append(out[-1] * step)
    return Rotation.concatenate(out)


def dipole(places: Values, moments: Values, at: Values) -> Values:
    """Fields (n, chips, 3) of dipoles (n, 3) at points (chips, 3)."""
    r = at[None] - places[:, None]
    distance = np.linalg.norm(r, axis=-1, keepdims=True)
    along = (r * moments[:, None]).sum(axis=-1, keepdims=True) / distance
    return np.asarray(MU0_OVER_4PI * (3 * r / distance * along - moments[:, None]) / distance**3)


def rod(places: Values, moments: Values, length: float, at: Values) -> Values:
    """Fields of long magnets: a pole at each end."""
    size = np.linalg.norm(moments, axis=-1, keepdims=True)
    half, pole = 0.5 * length * moments / size, (size / length)[:, None]
    parts = [sign * (at[None] - (places + sign * half)[:, None]) for sign in (1.0, -1.0)]
    return np.asarray(
        sum(
            MU0_OVER_4PI * pole * part / np.linalg.norm(part, axis=-1, keepdims=True) ** 3
            for part in parts
        )
    )


def gradient(size: float, rng: np.random.Generator) -> Values:
    """(3, 3) T/m without curl and divergence, RMS of its singular values `size`."""
    G = rng.normal(size=(3, 3))
    G = G + G.T - 2 * np.trace(G) / 3 * np.eye(3)
    return np.asarray(size * G / np.sqrt((G**2).sum() / 3))


def table(path: Path, t: Values, y: Values) -> None:
    """Readings (n, chips, 3) as a CSV file in uT, empty where NaN."""
    names = [f"m{k + 1}_{axis}" for k in range(y.shape[1]) for axis in "xyz"]
    rows = [
        ",".join([f"{at:.6f}", *("" if np.isnan(v) else f"{v:.6g}" for v in row)])
        for at, row in zip(t, 1e6 * y.reshape(len(y), -1))
    ]
    path.write_text("\n".join([",".join(["t", *names]), *rows]) + "\n")


def description(path: Path, board: Board, **known: float) -> None:
    """The array's file."""
    chips = {f"m{k + 1}": {"place": place.tolist()} for k, place in enumerate(board.declared)}
    path.write_text(json.dumps({"unit": "uT", **known, "magnetometers": chips}))
