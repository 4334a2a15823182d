"""Options of methods, devices and measures, declared once: default, unit, meaning and source stand
in one line."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar

UNBOUNDED = 1e6
Part = TypeVar("Part")


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
    least: float
    most: float
    earlier: str  # its name in the first edition, where that was another


def option(
    default: Any,
    unit: str,
    meaning: str,
    source: str,
    choices: tuple[str, ...] = (),
    least: float = 0.0,
    most: float = UNBOUNDED,
    earlier: str = "",
) -> Any:
    """A dataclass field with its unit, meaning and source; `choices` lists the words allowed where
    it is one, `least` and `most` bound a number, `earlier` is a name that stored results know it by."""
    words = {
        "unit": unit,
        "meaning": meaning,
        "source": source,
        "choices": choices,
        "least": least,
        "most": most,
        "earlier": earlier,
    }
    return field(default=default, metadata=words)


def describe(params_type: type) -> list[Description]:
    """All options of a Params dataclass, in order of declaration."""
    return [_describe(f) for f in fields(params_type)]


def with_present_names(params_type: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of which some may bear the names of the first edition."""
    present = {d.earlier: d.name for d in describe(params_type) if d.earlier}
    return {present.get(name, name): value for name, value in given.items()}


def values_of(params: Any) -> dict[str, Any]:
    """Every option of a Params by name, in order of declaration."""
    return {d.name: vars(params)[d.name] for d in describe(type(params))}


def changed_options(params: Any) -> dict[str, Any]:
    """The values of a Params that are not the default, by name."""
    values = values_of(params)
    return {d.name: values[d.name] for d in describe(type(params)) if values[d.name] != d.default}


def part_of(params: Part, part: type[Part]) -> Part:
    """The options of a Params that one of its base classes declares, as that class."""
    return part(**{d.name: vars(params)[d.name] for d in describe(part)})


def _describe(f: "Field[Any]") -> Description:
    assert f.default is not MISSING and {"unit", "meaning", "source"} <= set(f.metadata), (
        f"option {f.name} is not declared by option(...)"
    )
    return Description(f.name, f.default, type(f.default).__name__, **f.metadata)
