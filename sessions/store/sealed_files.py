"""Files that only the holder of a key opens: backups in the format age (age-encryption.org/v1, which the program `age` reads and writes, too).

A file is sealed for one or more recipients (`age1...`); the server has those alone, and cannot open what it has sealed. The key
(`AGE-SECRET-KEY-1...`) lies in a file that its owner keeps elsewhere.
"""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.sessions.sealing.keys import write_new_key
from handscope.sessions.sealing.stored import create_stored, open_stored

MAGIC = b"age-encryption.org/"
ENDING = ".age"
BUFFER = 2**20  # bytes written at a time
MISSING = phrase("sealed.no_package")


def is_sealed(path: Path) -> bool:
    """Whether a file begins as such a file does."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
    return False


def seal(source: Path, target: Path, recipients: Sequence[str]) -> None:
    """Seal a file, which stays as it is; InputError where a recipient is none."""
    pyrage = _library()
    try:
        known = [pyrage.x25519.Recipient.from_str(r.strip()) for r in recipients]
    except pyrage.RecipientError:
        raise InputError("sealed.recipient_form") from None
    os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600))
    with open_stored(source) as file, target.open("r+b") as out:
        pyrage.encrypt_io(file, out, known)
        out.flush()
        os.fsync(out.fileno())


def unseal(source: Path, target: Path, keys: Sequence[Path]) -> None:
    """Open a sealed file into another, new and private, sealed by a data key where this process has one; InputError where no key fits, or the file was changed."""
    pyrage = _library()
    identities = [identity for file in keys for identity in _read_keys(file)]
    target.unlink(missing_ok=True)
    try:
        with source.open("rb") as file, create_stored(target, BUFFER) as out:
            pyrage.decrypt_io(file, out, identities)
    except pyrage.DecryptError as problem:
        target.unlink(missing_ok=True)
        raise InputError("sealed.key_does_not_open", source=str(source), problem=problem) from None
    except OSError as problem:
        target.unlink(missing_ok=True)
        raise InputError(
            "sealed.sealed_damaged", source=str(source), problem=str(problem)
        ) from None


@contextlib.contextmanager
def unsealed(source: Path, keys: Sequence[Path], beside: Path | None = None) -> Iterator[Path]:
    """The file as it is; a sealed one opened, in a private folder within `beside` that goes again."""
    if not is_sealed(source):
        yield source
        return
    if not keys:
        raise InputError("backup.sealed", source=str(source))
    with tempfile.TemporaryDirectory(prefix=".handscope-", dir=beside) as folder:
        plain = Path(folder) / source.name.removesuffix(ENDING)
        unseal(source, plain, keys)
        yield plain


def make_key(file: Path) -> str:
    """A new key in a file that is its owner's alone; gives its recipient."""
    identity = _library().x25519.Identity.generate()
    recipient = str(identity.to_public())
    write_new_key(file, f"# recipient: {recipient}\n{identity}\n")
    return recipient


def reseal(file: Path, keys: Sequence[Path], recipients: Sequence[str]) -> None:
    """Seal a file for other recipients, in its place; what was sealed before is gone only when the new one can be read."""
    if not is_sealed(file):
        raise InputError("sealed.not_sealed", file=str(file))
    partial = file.with_name(f".{file.name}.partial")
    try:
        with unsealed(file, keys, file.parent) as plain:
            seal(plain, partial, recipients)
        os.replace(partial, file)
    finally:
        partial.unlink(missing_ok=True)


def _read_keys(file: Path) -> list[Any]:
    pyrage = _library()
    try:
        lines = [line.strip() for line in file.read_text("utf-8").splitlines()]
        found = [line for line in lines if line and not line.startswith("#")]
        return [pyrage.x25519.Identity.from_str(line) for line in found]
    except OSError as problem:
        raise InputError(
            "sealed.key_unreadable", file=str(file), strerror=describe(problem)
        ) from None
    except (UnicodeDecodeError, pyrage.IdentityError):
        raise InputError("sealed.not_a_key", file=str(file)) from None


def _library() -> Any:
    try:
        import pyrage
    except ImportError:
        raise InputError(MISSING) from None
    return pyrage
