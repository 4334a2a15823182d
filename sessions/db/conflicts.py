"""Two people change the same thing at once: the second is told, and nothing is overwritten unseen."""

from handscope.estimators.errors import InputError


class ConflictError(InputError):
    """What was to be changed is no longer what was seen."""


def require_seen(sentence: str, version: int, seen: int) -> None:
    """ConflictError with this sentence where the version that was seen is not the one stored."""
    if version != seen:
        raise ConflictError(sentence)
