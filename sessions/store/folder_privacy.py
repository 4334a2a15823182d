"""The data folder is its owner's alone: folders 700, files 600, whatever the umask.

What a process makes from `keep_private` on is private. What lies there from an earlier version, or was copied in, is mended at the start.
"""

import contextlib
import logging
import os
import stat
from collections.abc import Iterator
from pathlib import Path

log = logging.getLogger(__name__)
OTHERS = 0o077  # permission bits of group and others


def keep_private() -> None:
    """From now on this process, and those that it starts, make files that only their owner may open."""
    os.umask(OTHERS)


def mend_permissions(folder: Path) -> int:
    """Take the permissions of group and others from a folder and everything in it; how many had some. One line in the log says so."""
    mended = failed = 0
    for place in (folder, *_inside(folder)):
        try:
            mode = place.lstat().st_mode
            if stat.S_ISLNK(mode) or not mode & OTHERS:
                continue
            place.chmod(stat.S_IMODE(mode) & ~OTHERS)
            mended += 1
        except FileNotFoundError:  # it was removed meanwhile
            continue
        except OSError:
            failed += 1
    if mended:
        log.warning(
            "%d files of %s could be read by others; now only by their owner", mended, folder
        )
    if failed:
        log.error(
            "%d files of %s belong to somebody else and stay readable by others", failed, folder
        )
    return mended


def _inside(folder: Path) -> Iterator[Path]:
    """Every folder and file below, links not followed."""
    with contextlib.suppress(OSError):
        for above, folders, files in os.walk(folder):
            for name in (*folders, *files):
                yield Path(above, name)
