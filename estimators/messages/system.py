"""Words for what the operating system reports, with their codes where a person can do something about it."""

import errno
from collections.abc import Mapping

from handscope.estimators.messages.sentence import phrase

REPORTS: Mapping[int, str] = {
    errno.ENOSPC: phrase("system.no_space"),
    errno.EDQUOT: phrase("system.quota_exceeded"),
    errno.EFBIG: phrase("system.file_too_large"),
    errno.EIO: phrase("system.input_output"),
    errno.EROFS: phrase("system.read_only"),
    errno.ENOENT: phrase("system.no_such_file"),
    errno.EACCES: phrase("system.permission_denied"),
}


def describe(problem: Exception) -> str:
    """What happened, without the file's name; another error's own words."""
    words = getattr(problem, "strerror", None)
    known = REPORTS.get(getattr(problem, "errno", None) or 0, "")
    return known if words and known == words else str(words or problem)
