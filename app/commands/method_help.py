"""What `--help` says of the methods, as it is kept in method_help.json: importing all of them would take half a second."""

import json
import sys
from typing import Any

from handscope.app.options import help_text
from handscope.estimators.methods import ALL_METHODS, DEFAULT, DEFAULT_OF_ORIENTATIONS
from handscope.estimators.pipeline.method import AnyMethod, capability_words


def text() -> str:
    """The file."""
    methods = {
        name: {"title": _line_of(name, m), "options": help_text(m.Params)}
        for name, m in ALL_METHODS.items()
    }
    known = {
        "default": DEFAULT,
        "default_of_orientations": DEFAULT_OF_ORIENTATIONS,
        "methods": methods,
    }
    return json.dumps(known, indent=1, ensure_ascii=False) + "\n"


def _line_of(name: str, method: AnyMethod[Any]) -> str:
    """A method with what it needs and can do, for the list of methods."""
    return f"  {name}: {method.TITLE}\n      {'; '.join(capability_words(method.CAPABILITIES))}"


if __name__ == "__main__":
    sys.stdout.write(text())
