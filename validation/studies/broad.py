"""The fusion of the methods on real recordings: ten trials of BROAD, an inertial sensor on a rigid board with optical truth.

In      trials of BROAD as their authors publish them (MATLAB files, data_mat of the repository)
Source  Laidig, Caruso, Cereatti & Seel 2021, Data 6(7):72, doi:10.3390/data6070072; licence of the data: CC BY 4.0
Limits  ten of the 39 trials, those listed here
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from vqf import VQF

from handscope.app.report.units import DEG
from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation import fusion as orientation_fusion
from handscope.estimators.orientation.fusion import FusionParams
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import OrientationError, orientation_error, rms
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, Verdict, spread

SOURCE = "https://github.com/dlaidig/broad"
FIELDS = ("imu_gyr", "imu_acc", "imu_mag", "opt_quat", "movement", "sampling_rate")
FUSIONS: Mapping[str, tuple[tuple[str, ...], FusionParams]] = {
    "6D": ((GYR, ACC), FusionParams()),
    "9D": ((GYR, ACC, MAG), FusionParams()),
    "9D, no mag_rejection": ((GYR, ACC, MAG), FusionParams(mag_rejection=False)),
    "6D, gyr_reading=instant": ((GYR, ACC), FusionParams(gyr_reading="instant")),
}
COLUMNS = (
    "inclination 6D",
    "inclination 6D, gyr_reading=instant",
    "inclination 9D",
    "heading 9D",
    "total 9D",
    "total 9D, no mag_rejection",
    "total VQF",
)
INCLINATION_TARGET, TOTAL_TARGET = 1.0, 3.0  # deg on average over the ten trials


@dataclass(frozen=True)
class Trial:
    """One recording: the sensor's samples and its orientation as the cameras saw it."""

    name: str
    rate: float  # Hz
    gyr: Array  # (n, 3) rad/s
    acc: Array  # (n, 3) m/s^2
    mag: Array  # (n, 3) T
    q_ref: Array  # (n, 4) takes vectors from the sensor to the earth frame (east, north, up); NaN where the cameras lost it
    movement: Bools  # (n,) the samples that count


def trials(wanted: Wanted) -> Sequence[Path]:
    """The files; InputError with where to get them where one is missing."""
    files = [wanted.broad_data / f"{name}.mat" for name in published.BROAD]
    missing = [file.name for file in files if not file.is_file()]
    if missing:
        raise InputError(
            f"{len(missing)} of {len(files)} trials of BROAD are not in {wanted.broad_data} (first {missing[0]}); "
            f"copy data_mat of {SOURCE} (CC BY 4.0) there, or name its folder with --broad-data or HANDSCOPE_BROAD"
        )
    return files


def read(path: Path) -> Trial:
    """A trial from its file; InputError where it is not one."""
    try:
        content = loadmat(path, squeeze_me=True, variable_names=FIELDS)
    except (OSError, ValueError, TypeError, NotImplementedError) as problem:
        raise InputError(
            f"{path} cannot be read as a trial of BROAD: {problem}; copy it again from {SOURCE}"
        ) from None
    if absent := [name for name in FIELDS if name not in content]:
        raise InputError(f"{path} has no {absent[0]}; is it a trial of BROAD ({SOURCE}, data_mat)?")
    gyr, acc, mag, q_ref, movement = (np.ascontiguousarray(content[name]) for name in FIELDS[:-1])
    return Trial(
        path.stem,
        float(content["sampling_rate"]),
        gyr,
        acc,
        1e-6 * mag,
        q_ref,
        movement.astype(bool),
    )


def estimate_orientation(trial: Trial, quantities: tuple[str, ...], params: FusionParams) -> Array:
    """Orientations (n, 4) by the fusion of the methods."""
    values = {GYR: trial.gyr, ACC: trial.acc, MAG: trial.mag}
    stream = Stream("imu", ("hand",), quantities, trial.rate)
    block = Block(
        stream,
        np.arange(len(trial.gyr)) / trial.rate,
        np.concatenate([values[q] for q in quantities], axis=1)[:, None],
    )
    state, found = orientation_fusion.step(params, orientation_fusion.start(stream, {}, {}), block)
    _, rest = orientation_fusion.finish(params, state)
    return np.concatenate([found.q_GS, rest.q_GS])[:, 0]


def score(trial: Trial, q_GS: Array) -> OrientationError:
    """The error where the board moves and the cameras see it."""
    counts = trial.movement & np.isfinite(trial.q_ref).all(axis=1)
    return orientation_error(q_GS[counts], trial.q_ref[counts])


def measure(path: Path) -> dict[str, float]:
    """Root mean squares in deg by column; the package vqf with its own defaults beside ours."""
    trial = read(path)
    found = {
        name: score(trial, estimate_orientation(trial, *fusion)) for name, fusion in FUSIONS.items()
    }
    plain = score(trial, _vqf_orientation(trial))
    parts = {
        f"{part} {name}": getattr(error, part)
        for name, error in found.items()
        for part in ("inclination", "heading", "total")
    }
    return {
        name: DEG * rms(error)
        for name, error in {**parts, "total VQF": plain.total}.items()
        if name in COLUMNS
    }


def finding(wanted: Wanted, results: Sequence[tuple[Path, dict[str, float]]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    rows = [_row(path.stem, found, published.BROAD[path.stem]) for path, found in results]
    columns: dict[str, Spread] = {
        name: spread(found[name] for _, found in results) for name in COLUMNS
    }
    of_papers = {
        name: [values[name] for values in published.BROAD.values()]
        for name in published.BROAD_FILTERS
    }
    mean = Row("mean", columns | {name: spread(values) for name, values in of_papers.items()})
    table = Table(
        "RMSE in deg while the board moves",
        (*COLUMNS, *published.BROAD_FILTERS),
        (*rows, mean),
        head="trial",
        over="trials",
    )
    incl, total = (columns[name].mean for name in ("inclination 6D", "total 9D"))
    verdicts = (
        Verdict(
            "inclination of the 6D fusion, mean of the trials",
            incl,
            INCLINATION_TARGET,
            "deg",
            "our target",
        ),
        Verdict(
            "total of the 9D fusion, mean of the trials", total, TOTAL_TARGET, "deg", "our target"
        ),
    )
    return Finding(
        "broad",
        "The fusion on real trials (BROAD)",
        _setting(),
        (table,),
        verdicts,
        _remarks(columns),
        simulated=False,
    )


def _remarks(columns: Mapping[str, Spread]) -> tuple[str, ...]:
    mean, instant, without, package = (
        columns[name].mean
        for name in (
            "inclination 6D",
            "inclination 6D, gyr_reading=instant",
            "total 9D, no mag_rejection",
            "total VQF",
        )
    )
    return (
        f"The fusion is the package vqf ({package:.2f} deg with its own defaults); ours trusts biases found at rest less (`rest_turn`), because a worn "
        "sensor hardly ever rests.",
        f"`gyr_reading`: taking a gyroscope's sample for the mean rate since the one before fits this sensor better ({mean:.2f} deg of inclination) than "
        f"taking it for the rate at its instant ({instant:.2f} deg): filtered sensors average.",
        f"`mag_rejection=false` is the paper's filter: {without:.2f} deg.",
    )


def _row(name: str, found: Mapping[str, float], theirs: Mapping[str, float]) -> Row:
    return Row(name, {column: spread([value]) for column, value in {**found, **theirs}.items()})


def _vqf_orientation(trial: Trial) -> Array:
    """The package vqf alone, default parameters."""
    gyr, acc, mag = (np.ascontiguousarray(a) for a in (trial.gyr, trial.acc, 1e6 * trial.mag))
    return np.asarray(VQF(1.0 / trial.rate).updateBatch(gyr, acc, mag)["quat9D"])


def _setting() -> tuple[str, ...]:
    return (
        "Ten trials of BROAD (Laidig, Caruso, Cereatti & Seel 2021, Data 6(7):72, doi:10.3390/data6070072; CC BY 4.0): one inertial sensor "
        "(myon aktos-t, 286 Hz) on a rigid board, optical truth. Nothing is simulated and nothing fitted.",
        "`estimators/orientation/fusion.py` as the methods use it: 6D is `m2`'s, 9D that of `m1` (default options), beside them single "
        "options changed. The error is q_GS conj(q_opt), scored where the data set says that the board moves and the cameras see it; heading is "
        "its turn about the vertical, inclination the rest. 6D has no heading.",
        "Beside it: the package vqf alone with its own defaults (Laidig & Seel 2023), run here; Madgwick's and Mahony's filters with the parameters "
        "that do best on average over all trials, as the data set's authors publish them.",
    )
