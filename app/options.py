"""Options of a Params dataclass from a user's text; unknown names and values are refused with the list of valid ones."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from handscope.estimators.data.options import Description, describe
from handscope.estimators.errors import InputError


def with_options(params_type: type, given: Mapping[str, Any]) -> Any:
    """Params with the given options set; values may be text."""
    descriptions = {d.name: d for d in describe(params_type)}
    unknown = [name for name in given if name not in descriptions]
    if unknown:
        raise InputError(
            f"there is no option {unknown[0]!r}; options are {', '.join(descriptions)}"
        )
    return replace(
        params_type(), **{name: _value(descriptions[name], value) for name, value in given.items()}
    )


def parse(pairs: list[str]) -> dict[str, str]:
    """`key=value` words of a command line."""
    given = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise InputError(f"option {pair!r} is not of the form key=value")
        given[key] = value
    return given


def help_text(params_type: type) -> str:
    """One line an option: default, unit, meaning, source."""
    lines = []
    for d in describe(params_type):
        words = f" [{'|'.join(d.choices)}]" if d.choices else ""
        lines.append(
            f"  {d.name}={d.default}{' ' + d.unit if d.unit else ''}{words}: {d.meaning} ({d.source})"
        )
    return "\n".join(lines)


def _value(d: Description, value: Any) -> Any:
    text = str(value).strip()
    if d.choices and text not in d.choices:
        raise InputError(f"option {d.name} is {text!r}; it is one of {', '.join(d.choices)}")
    if d.kind == "bool":
        if text.lower() not in ("true", "false", "yes", "no", "1", "0", "on", "off"):
            raise InputError(f"option {d.name} is {text!r}; it is true or false")
        return text.lower() in ("true", "yes", "1", "on")
    if d.kind in ("float", "int"):
        try:
            number = float(text) if d.kind == "float" else int(text)
        except ValueError:
            raise InputError(
                f"option {d.name} is {text!r}; it is a number{' in ' + d.unit if d.unit else ''}"
            ) from None
        if not d.least <= number <= d.most:
            raise InputError(
                f"option {d.name} is {text!r}; it is between {d.least:g} and {d.most:g}{' ' + d.unit if d.unit else ''}"
            )
        return number
    return text
