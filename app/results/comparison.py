"""The comparison of two recordings as text, CSV and JSON; all differences are B minus A."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any, Literal

import orjson

from handscope.app.report.units import DEG, READABLE
from handscope.app.version import software_version
from handscope.estimators.measures.comparison import Agreement, Consistency
from handscope.estimators.measures.synchronisation import Lag
from handscope.estimators.measures.tip_errors import Frame, TipError
from handscope.estimators.pipeline.optical_trajectory import Rigidity
from handscope.sessions.tables_io.spreadsheet import write_table

COLUMNS = (
    "task", "onset_s", "end_s", "name", "unit", "samples", "share", "rom_a", "rom_b", "drom",
    "drms", "offset", "drms_minus_offset", "limit_low", "limit_high", "correlation",
)  # fmt: skip
# columns in the row's unit
LENGTHS = "rom_a", "rom_b", "drom", "drms", "offset", "drms_minus_offset", "limit_low", "limit_high"
# forms of the Bland-Altman plot
PLOTS: tuple[Literal["svg", "png", "pdf"], ...] = "svg", "png", "pdf"
SIGN = "differences are B minus A: a positive offset says that B reads more"


@dataclass(frozen=True)
class Side:
    """One of the two recordings, in words and with what was checked of it alone."""

    name: str  # of its file
    source: str  # by m2, markers, joint angles, ...
    samples: int
    consistency: tuple[Consistency, ...] = ()
    rigidity: tuple[Rigidity, ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Compared:
    """Everything a comparison says."""

    a: Side
    b: Side
    lag: Lag
    how: str  # the lag was found: cross-correlation, given, one recording
    agreements: tuple[Agreement, ...]
    tips: "Tips"


@dataclass(frozen=True)
class Tips:
    """Distances of the fingertips by stretch (name, onset, end), and how the two frames were aligned."""

    frame: Frame
    errors: Mapping[tuple[str, float, float], tuple[TipError, ...]]


def as_text(compared: Compared) -> str:
    """For a terminal: degrees and millimetres."""
    lines = [*_head(compared), f"{SIGN}; angles in deg, the distance of the tips in mm"]
    parts = dict.fromkeys((g.task, g.onset, g.end) for g in compared.agreements)
    width = max([len(g.name) for g in compared.agreements], default=10)
    for task, onset, end in parts:
        lines += ["", f"{task}, {onset:.1f} to {end:.1f} s", _heading(width)]
        lines += [
            _row(g, width)
            for g in compared.agreements
            if (g.task, g.onset, g.end) == (task, onset, end)
        ]
        lines += _tips(compared.tips, (task, onset, end))
    for letter, side in (("A", compared.a), ("B", compared.b)):
        lines += _checks(letter, side)
    return "\n".join(lines)


def as_csv(compared: Compared) -> bytes:
    """A row a quantity and task, in the unit named; comment lines (#) before the header."""
    preamble = (
        *_head(compared),
        SIGN,
        "angles: flexion, ulnar deviation and pronation are positive",
    )
    return write_table(COLUMNS, map(_readable_row, compared.agreements), preamble)


def as_json(compared: Compared) -> bytes:
    """The same in SI units, with the lag, the checks and the warnings; null where not known."""
    lag = compared.lag
    return orjson.dumps(
        {
            "signs": SIGN,
            "software_version": software_version(),
            "a": _side(compared.a),
            "b": _side(compared.b),
            "lag": {
                "seconds": lag.seconds,
                "how": compared.how,
                "correlation": lag.correlation,
                "overlap": lag.overlap,
                "rival": lag.rival,
                "at": lag.at,
                "drift": lag.drift,
            },
            "agreements": [_values(g) for g in compared.agreements],
            "tips": {
                "frame": compared.tips.frame,
                "errors": [
                    {
                        "task": task,
                        "onset": onset,
                        "end": end,
                        "finger": e.finger,
                        "samples": e.samples,
                    }
                    | {
                        "mean": e.mean,
                        "sd": e.sd,
                        "rmse": e.rmse,
                        "largest": e.largest,
                        "rms_of_axes": e.parts,
                    }
                    for (task, onset, end), errors in compared.tips.errors.items()
                    for e in errors
                ],
            },
        },
        option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY,
    )


def _head(compared: Compared) -> list[str]:
    """What was compared and how the clocks stand."""
    lag = compared.lag
    at = f" at A's {lag.at:.1f} s" if lag.rate else ""
    lines = [
        f"A  {compared.a.name}, {compared.a.source}, {compared.a.samples} samples",
        f"B  {compared.b.name}, {compared.b.source}, {compared.b.samples} samples",
        f"lag ({compared.how}): A's time = B's time {_with_sign(lag.seconds)}{at}; correlation {lag.correlation:.3f} over {lag.overlap:.1f} s",
    ]
    if lag.drift:
        runs = f"{1e6 * abs(lag.drift.value):.1f} ± {1e6 * lag.drift.sd:.1f} ppm {'fast' if lag.drift.value > 0 else 'slow'}"
        end = lag.at + lag.overlap
        later = f"corrected, at A's {end:.1f} s the lag is {_with_sign(lag.seconds - lag.rate * lag.overlap)}"
        lines.append(
            f"clocks: B's runs {runs}; {later}"
            if lag.rate
            else f"clocks: no difference that matters (B's runs {runs})"
        )
    return lines


def _with_sign(seconds: float) -> str:
    return f"{'-' if seconds < -5e-5 else '+'} {abs(seconds):.4f} s"


def _heading(width: int) -> str:
    return f"{'':{width}}  {'RoM A':>7} {'RoM B':>7} {'dRoM':>7} {'dRMS':>7} {'offset':>7} {'dRMS-o.':>7}   {'limits of agreement':>19} {'r':>6}"


def _row(g: Agreement, width: int) -> str:
    factor = READABLE[g.unit][1]
    values = " ".join(
        f"{factor * v:7.1f}"
        for v in (g.rom_a, g.rom_b, g.drom, g.drms, g.offset, g.drms_minus_offset)
    )
    low, high = (factor * v for v in g.limits)
    return f"{g.name:{width}}  {values}   {f'{low:.1f} to {high:.1f}':>19} {'-' if math.isnan(g.correlation) else f'{g.correlation:.3f}':>6}"


def _tips(tips: Tips, part: tuple[str, float, float]) -> list[str]:
    errors = tips.errors.get(part, ())
    lines = (
        [
            f"fingertips apart, mm, frames: {tips.frame}     mean      SD    RMSE largest    x / y / z RMS"
        ]
        if errors
        else []
    )
    for e in errors:
        values = " ".join(f"{1e3 * v:7.1f}" for v in (e.mean, e.sd, e.rmse, e.largest))
        lines.append(
            f"{e.finger:{len(lines[0]) - 48}}  {values}    {' / '.join(f'{1e3 * v:.1f}' for v in e.parts)}"
        )
    return lines


def _checks(letter: str, side: Side) -> list[str]:
    lines = []
    if side.consistency:
        turned = [c for c in side.consistency if math.isfinite(c.share)]
        rows = (
            f": median {100 * median(c.share for c in turned):.1f} %"
            if turned
            else ": no segment turned enough"
        )
        lines += [
            "",
            f"{letter}: angular velocity of the estimate against the gyroscope, dRMS in % of its maximum{rows}",
        ]
        lines += [
            f"  {c.segment:18} {100 * c.share:5.1f} % of {DEG * c.largest:.0f} deg/s"
            for c in turned
        ]
    if side.rigidity:
        lines += ["", f"{letter}: markers of a segment against each other, mean (largest)"]
        lines += [
            f"  {r.segment:18} {1e3 * r.movement_mean:5.1f} ({1e3 * r.movement_max:.1f}) mm   {DEG * r.angle_mean:5.1f} ({DEG * r.angle_max:.1f}) deg"
            for r in side.rigidity
        ]
    return lines


def _values(g: Agreement) -> dict[str, Any]:
    """COLUMNS in SI."""
    figures = (g.rom_a, g.rom_b, g.drom, g.drms, g.offset, g.drms_minus_offset, *g.limits)
    return dict(
        zip(
            COLUMNS,
            (g.task, g.onset, g.end, g.name, g.unit, g.samples, g.share, *figures, g.correlation),
        )
    )


def _side(side: Side) -> dict[str, Any]:
    return {
        "name": side.name,
        "source": side.source,
        "samples": side.samples,
        "gyroscope_consistency": [
            {"segment": c.segment, "drms": c.drms, "largest": c.largest, "share": c.share}
            for c in side.consistency
        ],
        "marker_rigidity": [
            {
                "segment": r.segment,
                "movement_mean": r.movement_mean,
                "movement_max": r.movement_max,
                "angle_mean": r.angle_mean,
                "angle_max": r.angle_max,
            }
            for r in side.rigidity
        ],
        "warnings": side.warnings,
    }


def _readable_row(agreement: Agreement) -> list[Any]:
    row = _values(agreement)
    unit, factor = READABLE[agreement.unit]
    row |= {name: factor * row[name] for name in LENGTHS} | {"unit": unit}
    return [row[name] for name in COLUMNS]
