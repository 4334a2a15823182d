"""The checks' messages as sentences."""

from dataclasses import replace

from handscope.estimators.messages import Message, Value
from handscope.estimators.messages.sentence import Sentence


def sentence(message: Message) -> str:
    """A message in words, its numbers to three digits."""
    values = {name: _rounded(value) for name, value in message.values.items()}
    return Sentence(replace(message, values=values))


def _rounded(value: Value) -> Value:
    return value if isinstance(value, str) else float(f"{value:.3g}")
