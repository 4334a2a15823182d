"""Closed files of a data folder kept under a URL: `s3://bucket/folder`, or any other that fsspec opens.

A place belongs to one data folder: both hold the same mark, and two folders never share one. Objects have the names that the files have in the data
folder (`recordings/...`, `results/...`). Address and keys of the storage come from its own library's variables (AWS_ENDPOINT_URL_S3,
AWS_ACCESS_KEY_ID, ...): nothing of ours holds a secret.
"""

import contextlib
import hashlib
import json
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.tables_io.writing import save_file

MARK = "object-storage.json"
PIECE = 2**20
OPTIONS: dict[str, dict[str, Any]] = {  # by protocol
    "s3": {
        "config_kwargs": {"connect_timeout": 5, "read_timeout": 30, "retries": {"max_attempts": 2}},
        "use_listings_cache": False,
    },
    "file": {"auto_mkdir": True},
}


@dataclass(frozen=True)
class ObjectStorage:
    """The place of one data folder's files."""

    url: str
    folder: str  # which data folder's: the number in its mark


class UnreachableError(InputError):
    """The storage does not answer or refuses: nothing was changed, try again later."""


def find_attached(folder: Path) -> ObjectStorage | None:
    """The storage that a data folder's files are in, by its mark; None where they all lie in the folder."""
    try:
        return ObjectStorage(**json.loads((folder / MARK).read_bytes()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError):
        raise InputError("recording.storage_note_damaged", file=str(folder / MARK)) from None


def attach(folder: Path, url: str, shared: str | None = None) -> ObjectStorage:
    """Have a data folder's files kept there from now on; InputError where they are elsewhere, or where that place is another folder's.

    `shared` is the mark of the place that several servers have in common: their folders share it.
    """
    known = find_attached(folder)
    if known is not None and known.url != url:
        raise InputError("recording.storage_differs", folder=str(folder), place=known.url, url=url)
    if known is not None:
        return known
    _require_plain(url)
    storage = ObjectStorage(url, shared or uuid.uuid4().hex)
    with _reach(storage) as (fs, root):
        try:
            found = fs.cat_file(f"{root}/{MARK}")
        except FileNotFoundError:
            found = None
        if shared is None and found is None:
            fs.pipe_file(
                f"{root}/{MARK}", json.dumps({"handscope data folder": storage.folder}).encode()
            )
    if shared is None and found is not None:
        raise InputError("recording.storage_in_use", url=url)
    if shared is not None and (found is None or _whose(found) != shared):
        raise InputError("recording.storage_not_shared", url=url)
    save_file(json.dumps(asdict(storage)).encode(), folder / MARK)
    return storage


def require(storage: ObjectStorage) -> None:
    """UnreachableError where it does not answer, or where what answers is not the place that was attached."""
    with _reach(storage) as (fs, root):
        try:
            whose = _whose(fs.cat_file(f"{root}/{MARK}"))
        except FileNotFoundError:
            whose = None
    if whose != storage.folder:
        raise UnreachableError(phrase("storage.other_bucket", url=storage.url))


def _whose(mark: bytes) -> str | None:
    """The data folder that a mark names; None where it is damaged."""
    try:
        return str(json.loads(mark)["handscope data folder"])
    except (ValueError, TypeError, KeyError):
        return None


def put(storage: ObjectStorage, name: str, path: Path) -> str:
    """Bring a file there; gives the SHA-256 of what lies there then, read back."""
    with _reach(storage) as (fs, root):
        fs.put_file(str(path), f"{root}/{name}")
    total = hashlib.sha256()
    for piece in pieces(storage, name):
        total.update(piece)
    return total.hexdigest()


def pieces(storage: ObjectStorage, name: str) -> Iterator[bytes]:
    """A file's bytes; FileNotFoundError where it is not there."""
    with (
        _reach(storage) as (fs, root),
        fs.open(f"{root}/{name}", "rb", block_size=4 * PIECE) as file,
    ):
        while piece := file.read(PIECE):
            yield piece


def size(storage: ObjectStorage, name: str) -> int:
    """Bytes of a file; FileNotFoundError where it is not there."""
    with _reach(storage) as (fs, root):
        return int(fs.size(f"{root}/{name}"))


def names(storage: ObjectStorage, folder: str, begin: str = "") -> list[str]:
    """The files in a folder there whose names begin so, as the data folder calls them."""
    with _reach(storage) as (fs, root):
        found = [path.removeprefix(root).lstrip("/") for path in fs.find(f"{root}/{folder}")]
    return sorted(name for name in found if name.startswith(f"{folder}/{begin}"))


def remove(storage: ObjectStorage, name: str) -> None:
    """A file is gone from there, whether it was there or not."""
    with _reach(storage) as (fs, root), contextlib.suppress(FileNotFoundError):
        fs.rm_file(f"{root}/{name}")


@contextlib.contextmanager
def _reach(storage: ObjectStorage) -> Iterator[tuple[Any, str]]:
    """The file system and our place on it; whatever goes wrong on the way there is UnreachableError, what is not there FileNotFoundError."""
    try:
        import fsspec
    except ImportError:
        raise InputError("recording.storage_package_missing", url=storage.url) from None
    protocol = storage.url.partition("://")[0]
    try:
        fs, root = fsspec.core.url_to_fs(storage.url, **OPTIONS.get(protocol, {}))
        yield fs, root.rstrip("/")
    except (InputError, FileNotFoundError):
        raise
    except ImportError as problem:
        raise InputError(
            "recording.storage_package_broken", url=storage.url, problem=str(problem)
        ) from None
    except Exception as problem:  # each file system's library has errors of its own
        raise UnreachableError(
            phrase("storage.unreachable", url=storage.url, problem=_words(problem))
        ) from problem


def _words(problem: Exception) -> str:
    """The first line of what a library says, without the query of an address."""
    return (str(problem).strip().splitlines() or [type(problem).__name__])[0].partition("?")[0][
        :200
    ]


def _require_plain(url: str) -> None:
    protocol, separator, place = url.partition("://")
    if not (protocol and separator and place.strip("/")):
        raise InputError("recording.storage_address", url=url)
    if ":" in place.partition("@")[0] and "@" in place:
        raise InputError("recording.storage_password")
