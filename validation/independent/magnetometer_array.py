"""A magnet before boards of magnetometers, by a simulator that shares nothing with the program: chips as they are made, faults, and fields that are not as assumed.

Every trial goes the way of somebody's own recording: tables are written, and `handscope locate` estimates positions.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from handscope.validation.independent.simulator import board as boards
from handscope.validation.independent.simulator.board import EARTH, Board, Chips, dipole
from handscope.validation.independent.simulator.hand import Values
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, spread

SECONDS, RATE = 3.0, 40.0
TURNED = 20.0, 40.0  # s, Hz
MOMENT = 0.4
WRONG, SURE = 0.002, 2.5  # m, standard deviations: found, but further off is surely wrong
MANY = (5, 9, 16)


@dataclass(frozen=True)
class Scene:
    """While a magnet moves: what spoils the field at the chips, and the table."""

    t: Values  # (n,) s
    places: Values  # (n, 3) m, of the magnet
    moments: Values  # (n, 3) A m^2
    board: Board
    rng: np.random.Generator


USUAL = Chips()


@dataclass(frozen=True, kw_only=True)
class Condition:
    """Chips and fields of one condition."""

    chips: Chips = USUAL
    low: float = 0.08  # m between which the magnet comes
    high: float = 0.18
    more_fields: Mapping[str, float] = field(default_factory=dict)  # in the array's file
    calibrated: bool = True  # by turning
    length: float = 0.0  # m of the magnet; 0: a dipole
    steps: bool = False  # put to a new place every half second
    carried: bool = False  # the board is turned by hand
    field: Callable[[Scene], Values] | None = None  # (n, chips, 3) T more
    spoilt: Callable[[Scene, Values], Values] | None = None  # readings as they are written
    many: tuple[int, ...] = MANY


def _uneven(size: float) -> Callable[[Scene], Values]:
    """A field that changes by so many T a metre."""
    return lambda s: np.repeat(
        (s.board.places @ boards.gradient(size, s.rng))[None], len(s.t), axis=0
    )


def _second(away: float, moment: float, moves: float = 0.0) -> Callable[[Scene], Values]:
    def made(s: Scene) -> Values:
        direction = np.array([0.8, 0.4, 0.45]) * away
        at = direction + moves * np.column_stack([np.sin(2 * s.t), 0 * s.t, np.cos(3 * s.t)])
        return dipole(
            at, np.repeat([[0, 0.83 * moment, 0.55 * moment]], len(s.t), axis=0), s.board.places
        )

    return made


def _hum(s: Scene) -> Values:
    return np.asarray(
        2e-6 * np.sin(2 * np.pi * 50 * s.t + 1.0)[:, None, None] * np.array([0.6, 0.0, 0.8])
    )


def _missing(s: Scene, y: Values) -> Values:
    return np.where(s.rng.random(y.shape[:2])[..., None] < 0.1, np.nan, y)


def _frozen(s: Scene, y: Values) -> Values:
    return np.where((np.arange(y.shape[1]) == 2)[None, :, None], y[:1], y)


def _silent(s: Scene, y: Values) -> Values:
    return np.where((np.arange(y.shape[1]) == 2)[None, :, None], np.nan, y)


def _exchange_axes(s: Scene, y: Values) -> Values:
    return y[:, [1, 0, *range(2, y.shape[1])]]


def _late(s: Scene, y: Values) -> Values:
    out = y.copy()
    out[2:, 1] = y[:-2, 1]
    return out


def _in_turn(s: Scene, y: Values) -> Values:
    """Each chip 5 ms after the one before."""
    when = [s.t - 0.005 * k for k in range(y.shape[1])]
    return np.stack(
        [
            np.column_stack([np.interp(t, s.t, axis) for axis in y[:, k].T])
            for k, t in enumerate(when)
        ],
        axis=1,
    )


KNOWN = {"moment": MOMENT}
PLAIN = Chips(hard=0.0, soft=0.0, turned=False)
CONDITIONS: Mapping[str, Condition] = {
    "moment told": Condition(more_fields=KNOWN, many=(3, 4, *MANY)),
    "moment not told": Condition(many=(3, 4, *MANY)),
    "the same, 15 to 25 cm away": Condition(more_fields=KNOWN, low=0.15, high=0.25),
    "the same, 4 to 8 cm away": Condition(more_fields=KNOWN, low=0.04, high=0.08),
    "hard iron 60 uT, soft iron 10 %": Condition(chips=Chips(hard=60e-6, soft=0.1)),
    "gains changed by 1 % since": Condition(chips=Chips(gain=0.01)),
    "places off by 1 mm, told so": Condition(
        chips=Chips(misplaced=1e-3), more_fields={"place_sd": 1e-3}
    ),
    "places off by 1 mm, not told": Condition(chips=Chips(misplaced=1e-3)),
    "not turned, readings without iron": Condition(chips=PLAIN, calibrated=False),
    "not turned, calibration_sd 0.3 uT": Condition(
        chips=PLAIN, calibrated=False, more_fields={"calibration_sd": 3e-7}
    ),
    "not turned, hard iron 20 uT": Condition(calibrated=False, chips=Chips(turned=False)),
    "mains hum of 2 uT": Condition(field=_hum),
    "the room's field changes by 5 uT/m": Condition(field=_uneven(5e-6), many=(4, *MANY)),
    "by 20 uT/m": Condition(field=_uneven(20e-6), many=(4, *MANY)),
    "by 20 uT/m, moment told": Condition(field=_uneven(20e-6), more_fields=KNOWN, many=(4, *MANY)),
    "by 100 uT/m": Condition(field=_uneven(100e-6), many=(4, *MANY)),
    "a second magnet of 0.36 A m^2 at 22 cm": Condition(field=_second(0.22, 0.36)),
    "the same, it moves": Condition(field=_second(0.22, 0.36, 0.05)),
    "at 50 cm": Condition(field=_second(0.5, 0.36)),
    "iron of 0.08 A m^2 at 12 cm": Condition(field=_second(0.12, 0.08)),
    "a rod of 1 cm, 2 to 6 cm away": Condition(length=0.01, low=0.02, high=0.06),
    "a rod of 4 cm, 3 to 8 cm away": Condition(length=0.04, low=0.03, high=0.08),
    "a rod of 4 cm, 8 to 18 cm away": Condition(length=0.04),
    "a tenth of all readings missing": Condition(spoilt=_missing),
    "a chip frozen": Condition(spoilt=_frozen),
    "a chip silent": Condition(spoilt=_silent),
    "two chips exchanged": Condition(spoilt=_exchange_axes),
    "a chip 50 ms late": Condition(spoilt=_late),
    "each chip 5 ms after the one before": Condition(spoilt=_in_turn),
    "each chip misaligned by 1 degree": Condition(chips=Chips(misaligned=np.radians(1.0))),
    "limit of 100 uT, 5 to 15 cm away": Condition(chips=Chips(limit=100e-6), low=0.05, high=0.15),
    "the board turned by hand": Condition(carried=True),
    "the magnet put to a new place every 0.5 s": Condition(steps=True),
}


@dataclass(frozen=True)
class Trial:
    """One run: condition, many and seed."""

    condition: str
    many: int  # chips
    seed: int


@dataclass(frozen=True)
class LocatedReadings:
    """Readings where a magnet was found, of all; distances of what was found from the truth."""

    readings: int
    off: Values  # (found,) m
    sd: Values  # (found,) m, of the place's three together
    squared: Values  # (found,) mean over the axes


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [
        Trial(name, many, seed)
        for name, one in CONDITIONS.items()
        for many in one.many
        for seed in range(wanted.seeds)
    ]


def measure(trial: Trial) -> LocatedReadings:
    """Positions of one recording by `locate`."""
    with TemporaryDirectory() as folder:
        scene = made(trial, Path(folder))
        words = [
            f"{folder}/magnet.csv",
            "--array",
            f"{folder}/board.json",
            "--out",
            f"{folder}/places.tsv",
        ]
        turned = (
            ["--turned", f"{folder}/turned.csv"] if CONDITIONS[trial.condition].calibrated else []
        )
        if _is_refused("locate", *words, *turned):
            return LocatedReadings(len(scene.t), *np.zeros((3, 0)))
        out = np.genfromtxt(f"{folder}/places.tsv", names=True, delimiter="\t")
    found = out["found"] > 0.5
    off = np.column_stack([out[axis] for axis in "xyz"])[found] - scene.places[found]
    sd = np.column_stack([out[f"{axis}_sd"] for axis in "xyz"])[found]
    return LocatedReadings(
        len(found),
        np.linalg.norm(off, axis=1),
        np.linalg.norm(sd, axis=1),
        ((off / sd) ** 2).mean(axis=1),
    )


def made(trial: Trial, folder: Path) -> Scene:
    """Write the trial's tables into a folder; the truth."""
    condition = CONDITIONS[trial.condition]
    of_board, of_turn, of_path, of_field, of_chips = np.random.default_rng(
        [trial.seed, trial.many]
    ).spawn(5)
    board = boards.draw_board(trial.many, condition.chips, of_board)
    t = np.arange(int(SECONDS * RATE)) / RATE
    places, moments = _path(condition, t, of_path)
    scene = Scene(t, places, moments, board, of_field)
    B = (
        boards.rod(places, moments, condition.length, board.places)
        if condition.length
        else dipole(places, moments, board.places)
    )
    around = (
        boards.by_hand(SECONDS, RATE, 0.8, of_turn).inv().apply(EARTH)
        if condition.carried
        else np.repeat(EARTH[None], len(t), axis=0)
    )
    B = B + around[:, None] + (0.0 if condition.field is None else condition.field(scene))
    y = boards.read_fields(board, B, of_chips)
    boards.table(
        folder / "magnet.csv", t, y if condition.spoilt is None else condition.spoilt(scene, y)
    )
    if condition.calibrated:
        turned_t, turned = boards.turn_board(board, *TURNED, of_turn)
        boards.table(
            folder / "turned.csv",
            turned_t,
            boards.read_fields(board, turned, of_chips, after_calibration=False),
        )
    boards.description(folder / "board.json", board, **condition.more_fields)
    return scene


def _path(condition: Condition, t: Values, rng: np.random.Generator) -> tuple[Values, Values]:
    """Places and moments (n, 3) of a magnet that goes to and fro before the board, turning."""
    when = np.floor(2 * t) * 3.7 if condition.steps else t
    frequency, phase = rng.uniform(0.1, 0.5, 3), rng.uniform(0, 2 * np.pi, 3)
    wave = np.sin(2 * np.pi * when[:, None] * frequency + phase)
    middle, swing = (condition.low + condition.high) / 2, (condition.high - condition.low) / 2
    places = np.column_stack(
        [min(0.08, condition.high / 2) * wave[:, :2], middle + swing * wave[:, 2]]
    )
    tilt, round_ = 1.2 * np.sin(0.4 * np.pi * when + phase[0]), 0.26 * np.pi * when
    return places, MOMENT * np.column_stack(
        [np.sin(tilt) * np.cos(round_), np.sin(tilt) * np.sin(round_), np.cos(tilt)]
    )


def _is_refused(*words: str) -> bool:
    """Run a command of the program."""
    from handscope.app import cli

    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        code = cli.main(list(words))
    assert code in (0, 2), words
    return code == 2


def finding(wanted: Wanted, results: Sequence[tuple[Trial, LocatedReadings]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    columns = (
        "found, %",
        "off, median, mm",
        "sd told, median, mm",
        "normalised error squared",
        "surely wrong, %",
    )
    rows = [
        Row(
            f"{name}, {many} chips",
            _figures(
                [
                    located
                    for trial, located in results
                    if (trial.condition, trial.many) == (name, many)
                ],
                columns,
            ),
        )
        for name, one in CONDITIONS.items()
        for many in one.many
    ]
    table = Table("Places of a magnet of 0.4 A m^2", columns, tuple(rows), head="", digits=1)
    return Finding(
        "independent-array",
        "A magnet before a board of magnetometers, by an independent simulator",
        _setting(wanted),
        (table,),
        (),
        _remarks(results),
    )


def _figures(each: Sequence[LocatedReadings], columns: Sequence[str]) -> dict[str, Spread]:
    """By column, over recordings; no errors where nothing is found."""
    figures = {
        columns[0]: spread([100 * len(one.off) / one.readings for one in each]),
        columns[4]: spread([100 * _surely_wrong(one) / one.readings for one in each]),
    }
    if some := [one for one in each if len(one.off)]:
        figures |= {
            columns[1]: spread([1e3 * float(np.median(one.off)) for one in some]),
            columns[2]: spread([1e3 * float(np.median(one.sd)) for one in some]),
            columns[3]: spread([float(one.squared.mean()) for one in some]),
        }
    return figures


def _surely_wrong(located: LocatedReadings) -> int:
    return int(((located.off > WRONG) & (located.off > SURE * located.sd)).sum())


def _setting(wanted: Wanted) -> tuple[str, ...]:
    return (
        f"{wanted.seeds} trials a row: `handscope reproduce independent-array --seeds {wanted.seeds}`. A simulator of magnets, fields and chips that shares no code with the program (`validation/independent/simulator/board.py`, numpy and scipy alone); tables in uT and the array's file go through `handscope locate`. "
        "Boards of 4, 9 and 16 chips are squares (pitch 8, 5 and 4 cm), of five a square of 16 cm with one in the middle, of three a triangle of 10 cm.",
        f"Every trial is another board, calibration and movement: {SECONDS:g} s at {RATE:g} Hz, a magnet of {MOMENT:g} A m^2 8 to 18 cm before the board where nothing else is said; 0.2 uT of noise an axis, 20 uT of hard and 3 % of soft iron, chips turned by quarters; "
        "calibrated with `--turned` where the field is even. What a row names is told to nobody but where it says so.",
        "Found: places that count (`found` 1), of all readings; none of a recording that is refused. Surely wrong: found, and off by more than 2 mm and by more than 2.5 of the standard deviations that are told, of all readings.",
    )


def _remarks(results: Sequence[tuple[Trial, Any]]) -> tuple[str, ...]:
    """Over all conditions: how much is confident and wrong."""
    readings, wrong = (
        sum(located.readings for _, located in results),
        sum(_surely_wrong(located) for _, located in results),
    )
    return (f"Surely wrong: {wrong} of {readings} readings ({100 * wrong / readings:.2f} %).",)
