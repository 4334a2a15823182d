"""The one exception for a user's mistake."""


class InputError(Exception):
    """A mistake in what the user gave us: says what happened, to which data, and what to do."""
