"""Options of methods, devices and measures, declared once: default, unit, meaning and source stand in one line."""

from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Description:
    """What a person needs to know of an option."""

    name: str
    default: Any
    kind: str  # "float", "int", "bool" or "str"
    unit: str
    meaning: str
    source: str
    choices: tuple[str, ...]


def option(default: Any, unit: str, meaning: str, source: str, choices: tuple[str, ...] = ()) -> Any:
    """A dataclass field with its unit, meaning and source; `choices` lists the words allowed where it is one."""
    return field(default=default, metadata={"unit": unit, "meaning": meaning, "source": source, "choices": choices})


def describe(params_type: type) -> list[Description]:
    """All options of a Params dataclass, in order of declaration."""
    return [_describe(f) for f in fields(params_type)]


def _describe(f: "Field[Any]") -> Description:
    assert f.default is not MISSING and {"unit", "meaning", "source"} <= set(f.metadata), f"option {f.name} is not declared by option(...)"
    return Description(
        f.name, f.default, type(f.default).__name__, f.metadata["unit"], f.metadata["meaning"], f.metadata["source"], f.metadata["choices"]
    )
