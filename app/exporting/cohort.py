"""A cohort's recordings processed by one method, spread over processes or machines by Dask; what was done before is not done again.

Each recording's derivative lies in a folder of its own, OUT/NAME, with `done.json` beside it: the key of what it was made from (the recording's checksum,
method, options, version). A recording that fails is named at the end and holds up no other.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handscope.app.exporting.measured import export_processed, gather
from handscope.app.exporting.saving import save
from handscope.app.options import with_options
from handscope.app.version import software_version
from handscope.app.workers.deadline import LIMIT, limit_time
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import ALL_METHODS, default_for
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.recording_checks.check import check_processed
from handscope.sessions.exports import format_of
from handscope.sessions.exports.measured import Measured
from handscope.sessions.files.native import SUFFIX, file_checksum
from handscope.sessions.formats import derivative
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file, save_folder

DONE = "done.json"
SUFFIXES = (SUFFIX, ".zip")
MISSING = phrase("cohort.no_package")


@dataclass(frozen=True)
class Work:
    """One recording to be processed: plain values, they travel to another machine."""

    name: str
    recording: str
    out: str
    method: str | None  # None: what suits the recording
    options: Mapping[str, Any]
    hand: Hand | None
    formats: tuple[str, ...] = ()  # of sessions/exports, written beside the derivative


@dataclass(frozen=True)
class Outcome:
    """What came of one recording of a cohort."""

    name: str
    state: str  # done, before (and is not done again), failed
    message: str = ""


def recordings(place: Path) -> dict[str, Path]:
    """The recordings of a folder, or of a text file with a path a line, by the name of their results; InputError where there are none."""
    if place.is_dir():
        found = [p for p in sorted(place.rglob("*")) if p.is_file() and p.suffix in SUFFIXES]
        named = {
            p.relative_to(place).with_suffix("").as_posix().replace("/", "--"): p for p in found
        }
        if len(named) < len(found):
            raise InputError("result.names_differ_by_suffix", place=str(place))
    elif place.is_file():
        try:
            lines = [line.strip() for line in place.read_text().splitlines()]
        except UnicodeDecodeError:
            raise InputError("result.not_a_list", place=str(place)) from None
        found = [place.parent / line for line in lines if line and not line.startswith("#")]
        named = {
            p.name.removesuffix(p.suffix) if p.suffix in SUFFIXES else p.name: p for p in found
        }
        if len(named) < len(found):
            raise InputError("result.name_twice", place=str(place))
    else:
        raise InputError("result.folder_or_list_missing", place=str(place))
    if not named:
        raise InputError("result.no_recordings", place=str(place), suffixes=" or ".join(SUFFIXES))
    return named


def one(work: Work) -> Outcome:
    """Process one recording, wherever this runs; whatever goes wrong is its outcome."""
    try:
        path, out = Path(work.recording), Path(work.out) / work.name
        key = _key(path, work)
        if _done(out) == key:
            return Outcome(work.name, "before")
        recording = formats_recordings.load(path, work.hand)
        name = work.method or default_for(recording.streams)
        method = ALL_METHODS[name]
        params = with_options(method.Params, work.options)
        made = process(method, params, recording, progress=limit_time(LIMIT, lambda share: None))
        processed = check_processed(made, recording)
        out.mkdir(parents=True, exist_ok=True)
        (out / DONE).unlink(missing_ok=True)
        save_folder(derivative.tree(processed, recording, name, params, software_version()), out)
        for wanted in work.formats:
            _export(gather(recording, processed, name, params), processed, out, params, wanted)
        save_file(
            json.dumps({"key": key, "warnings": list(processed.warnings)}, indent=1).encode(),
            out / DONE,
        )
    except InputError as problem:
        return Outcome(work.name, "failed", str(problem))
    except Exception as problem:  # one recording must not end the others' run
        return Outcome(work.name, "failed", f"{type(problem).__name__}: {problem}")
    return Outcome(work.name, "done")


def _export(measured: Measured, processed: Processed, out: Path, params: Any, name: str) -> None:
    """Write a format as OUT/NAME/NAME.ending, or into a folder OUT/NAME/FORMAT; `out` is OUT/NAME."""
    wanted = format_of(name)
    made = export_processed(measured, name, processed, params)
    save(made.files, out / (f"{out.name}{wanted.ending}" if wanted.ending else name))


def all_of(
    works: Sequence[Work], workers: int, scheduler: str | None, on_progress: Callable[[float], None]
) -> list[Outcome]:
    """Every recording's outcome in the order given, computed by processes of this machine or those of a scheduler."""
    outcomes: dict[str, Outcome] = {}
    with _client(workers, scheduler) as client:
        from distributed import as_completed

        asked = {
            client.submit(one, work, pure=False, key=f"{work.name}-{k}"): work
            for k, work in enumerate(works)
        }
        for future in as_completed(asked):
            work = asked[future]
            problem = future.exception()
            outcomes[work.name] = (
                future.result()
                if problem is None
                else Outcome(
                    work.name, "failed", phrase("cohort.process_ended", problem=str(problem))
                )
            )
            on_progress(len(outcomes) / len(works))
    return [outcomes[work.name] for work in works]


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(MISSING) from None
    try:
        if scheduler:
            with Client(scheduler, timeout=10) as client:
                yield client
        else:
            with (
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    dashboard_address=None,
                    memory_limit=None,
                ) as cluster,
                Client(cluster) as client,
            ):
                yield client
    except (OSError, TimeoutError) as problem:
        raise InputError(
            "result.scheduler_unreachable",
            value=scheduler or "of this machine",
            problem=str(problem),
        ) from None


def _key(path: Path, work: Work) -> str:
    sum_ = file_checksum(path) if path.is_file() else _folder_checksum(path)
    parts: list[Any] = [sum_, work.method, dict(work.options), work.hand, software_version()]
    parts += [sorted(work.formats)] if work.formats else []
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def _folder_checksum(path: Path) -> str:
    if not path.is_dir():
        raise InputError("result.recording_unknown", name=str(path))
    sums = [
        (p.relative_to(path).as_posix(), file_checksum(p))
        for p in sorted(path.rglob("*"))
        if p.is_file()
    ]
    return hashlib.sha256(repr(sums).encode()).hexdigest()


def _done(out: Path) -> str | None:
    try:
        return str(json.loads((out / DONE).read_text())["key"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
