"""Data keys: 32 bytes in a file that the administrator keeps, and a file's own key wrapped by one of them.

HANDSCOPE_DATA_KEY names the files of the keys, with the system's separator of paths between: the first seals what is written from now on, all of them
open what lies there.
"""

import base64
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

VARIABLE = "HANDSCOPE_DATA_KEY"
SEALED_MARK = "sealed"  # a file in a data folder that was opened with a key
FORM = "HANDSCOPE-DATA-KEY-1 "
SIZE, NONCE, TAG, NAME = 32, 12, 16, 8  # bytes of a key, a nonce, a tag, a key's name
WRAPPED = NAME + NONCE + SIZE + TAG  # bytes of a wrapped key


@dataclass(frozen=True)
class DataKey:
    """A key that wraps files' own keys."""

    secret: bytes

    @property
    def name(self) -> bytes:
        """Tells which key a file is sealed by, and nothing of the key."""
        return hashlib.sha256(b"handscope data key" + self.secret).digest()[:NAME]

    def wrap(self, file_key: bytes, about: bytes) -> bytes:
        """A file's key that this key alone opens; `about` must be the same then."""
        nonce = os.urandom(NONCE)
        return self.name + nonce + bytes(cipher(self.secret).encrypt(nonce, file_key, about))

    def unwrap(self, wrapped: bytes, about: bytes, what: str) -> bytes:
        """The file's key; InputError that names `what` where it was changed."""
        nonce, sealed = wrapped[NAME : NAME + NONCE], wrapped[NAME + NONCE :]
        try:
            return bytes(cipher(self.secret).decrypt(nonce, sealed, about))
        except Exception as problem:  # InvalidTag, of an optional package
            raise InputError("sealing.header_damaged", file=what) from problem


def make_key(file: Path) -> None:
    """A new key in a file that is its owner's alone."""
    write_new_key(file, FORM + base64.b64encode(os.urandom(SIZE)).decode() + "\n")


def write_new_key(file: Path, text: str) -> None:
    """A key's file that only its owner reads; InputError where there is one, or it cannot be written."""
    try:
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise InputError("sealed.key_exists", file=str(file)) from None
    except OSError as problem:
        raise InputError(
            "table.file_not_writable", file=str(file), problem=describe(problem)
        ) from None
    with os.fdopen(handle, "w") as out:
        out.write(text)


@lru_cache(maxsize=16)
def read_key(file: Path) -> DataKey:
    """The key in a file; InputError where there is none."""
    try:
        text = file.read_text("ascii").strip()
        secret = base64.b64decode(text.removeprefix(FORM), validate=True)
    except OSError as problem:
        raise InputError(
            "sealed.key_unreadable", file=str(file), strerror=describe(problem)
        ) from None
    except ValueError:
        raise InputError("sealing.not_a_key", file=str(file)) from None
    if not text.startswith(FORM) or len(secret) != SIZE:
        raise InputError("sealing.not_a_key", file=str(file))
    return DataKey(secret)


def keys_of_this_process() -> list[DataKey]:
    """The keys that the environment names, the sealing one first; none where nothing is sealed."""
    named = os.environ.get(VARIABLE, "")
    return [read_key(Path(word)) for word in named.split(os.pathsep) if word]


def mark_sealed(folder: Path) -> None:
    """Note in a data folder that it is sealed, where this process has a key; InputError where it was and this process has none."""
    keys = keys_of_this_process()
    if not keys and (folder / SEALED_MARK).exists():
        raise InputError("sealing.folder_needs_key", folder=str(folder), variable=VARIABLE)
    if keys:
        cipher(keys[0].secret)
        (folder / SEALED_MARK).touch()


def unwrap_by_any(
    keys: Sequence[DataKey], slots: Sequence[bytes], about: bytes, what: str
) -> bytes:
    """A file's key by whichever key fits; InputError where none does."""
    for key in keys:
        for slot in slots:
            if slot[:NAME] == key.name:
                return key.unwrap(slot, about, what)
    raise InputError("sealing.no_key_fits", what=what, variable=VARIABLE)


def cipher(secret: bytes) -> Any:
    """AES-256-GCM of the package cryptography."""
    try:
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM
    except ImportError:
        raise InputError("sealing.not_installed") from None
    return AESGCM(secret)
