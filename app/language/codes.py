"""The list of message codes for docs/message-codes.md: python -m handscope.app.language.codes."""

import sys

from handscope.estimators.messages import Text, english_texts

HEAD = """# Message codes

The API answers a mistake with `code` and `values` beside its sentence where the message has a code. Codes are stable: the words may be improved,
a code keeps its meaning. `{name}` is a value, `{size:.1f}` one with one decimal. Mistakes, warnings, findings, reasons of figures and the texts of tasks
have codes, which results store beside the text. Made by `python -m handscope.app.language.codes`, never edited.

| code | English |
|---|---|
"""


def table() -> str:
    """The page, codes in order."""
    rows = [f"| `{code}` | {_cell(text)} |\n" for code, text in sorted(english_texts().items())]
    return HEAD + "".join(rows)


def _cell(text: Text) -> str:
    words = text if isinstance(text, str) else " / ".join(text.values())
    return words.replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(table())
