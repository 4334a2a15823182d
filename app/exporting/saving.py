"""An export's files on the disk, whole or not at all; or packed for a download."""

from pathlib import Path

from handscope.estimators.errors import InputError
from handscope.sessions.exports import Format
from handscope.sessions.exports.measured import Files
from handscope.sessions.motion_bids.writer import pack
from handscope.sessions.tables_io.writing import save_file, save_folder


def save(files: Files, path: Path) -> None:
    """Write to a file, with those beside it, or to a folder."""
    if "" not in files:
        path.mkdir(parents=True, exist_ok=True)
        save_folder(dict(files), path)
    elif len(files) == 1:
        save_file(files[""], path)
    else:
        save_folder({_beside(path, ending): data for ending, data in files.items()}, path.parent)


def packed(files: Files, wanted: Format, stem: str) -> bytes:
    """The one file to send: a zip where there are several."""
    if not wanted.beside and wanted.ending:
        return files[""]
    named = {
        _beside(Path(stem + wanted.ending), e) if "" in files else e: d for e, d in files.items()
    }
    return pack(named)


def require_place(path: Path, wanted: Format) -> None:
    """InputError where the format cannot be written there; makes nothing."""
    if wanted.ending and path.is_dir():
        raise InputError("export.folder_in_place_of_file", path=str(path), ending=wanted.ending)
    if not wanted.ending and path.exists() and not path.is_dir():
        raise InputError("export.file_in_place_of_folder", path=str(path))
    if wanted.ending and not path.absolute().parent.is_dir():
        raise InputError("command.folder_missing", parent=str(path.parent), name=path.name)


def _beside(path: Path, ending: str) -> str:
    return (
        path.name
        if not ending
        else f"{path.stem}{ending}"
        if path.suffix != ending
        else f"{path.name}{ending}"
    )
