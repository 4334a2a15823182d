"""Put files on the disk whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.tables_io.number_table import Data, pieces


def save_folder(files: Mapping[str, Data], folder: Path) -> None:
    """Write files by relative path into a folder: first all beside it, then each into its place; on a failure everything is as it was."""
    try:
        staging = Path(tempfile.mkdtemp(prefix=".handscope-", dir=folder))
    except OSError as problem:
        raise InputError(
            "table.folder_not_writable", folder=str(folder), problem=describe(problem)
        ) from None
    try:
        for name, data in files.items():
            (staging / name).parent.mkdir(parents=True, exist_ok=True)
            with (staging / name).open("wb") as file:
                file.writelines(pieces(data))
        _exchange(staging, folder, list(files))
    except OSError as problem:
        raise InputError(
            "table.nothing_kept", folder=str(folder), problem=describe(problem)
        ) from None
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _exchange(staging: Path, folder: Path, names: list[str]) -> None:
    """Move files from the staging folder into their places; on a failure those that stood there before come back."""
    placed: list[tuple[Path, Path]] = []  # place, where the file that stood there waits
    try:
        for name in names:
            place, before = folder / name, staging / ".before" / name
            for parent in (place.parent, before.parent):
                parent.mkdir(parents=True, exist_ok=True)
            if place.is_file():
                shutil.copyfile(place, before)
            os.replace(staging / name, place)
            placed.append((place, before))
    except BaseException:  # an interruption, too
        for place, before in placed:
            place.unlink()
            if before.exists():
                os.replace(before, place)
        raise


def save_file(data: bytes, path: Path) -> None:
    """Write one file whole or not at all: a link's target in its place; a device or a pipe is written to as it is."""
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
        else:
            _replace(Path(os.path.realpath(path)), data)
    except OSError as problem:
        raise InputError(
            "table.file_not_writable", file=str(path), problem=describe(problem)
        ) from None


def _replace(path: Path, data: bytes) -> None:
    """Write beside the place first; on a failure the file that stood there is as it was."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_bytes(data)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
