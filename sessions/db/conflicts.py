"""Two people change the same thing at once: the second is told, and nothing is overwritten unseen."""

from handscope.estimators.errors import InputError


class ConflictError(InputError):
    """What was to be changed is no longer what was seen."""

    def __init__(self, what: str) -> None:
        super().__init__(
            f"{what} was changed in another window meanwhile; compare with what is stored now and choose"
        )


def require_seen(what: str, version: int, seen: int) -> None:
    """ConflictError where the version that was seen is not the one stored."""
    if version != seen:
        raise ConflictError(what)
