"""Options of a Params dataclass from a user's text; unknown names and values are refused with the list of valid ones."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from handscope.estimators.data.options import Description, describe, with_present_names
from handscope.estimators.errors import InputError


def with_options(params_type: type, given: Mapping[str, Any]) -> Any:
    """Params with the given options set; values may be text, names those of the first edition."""
    given = with_present_names(params_type, given)
    descriptions = {d.name: d for d in describe(params_type)}
    unknown = [name for name in given if name not in descriptions]
    if unknown:
        raise InputError("option.unknown_option", name=unknown[0], options=", ".join(descriptions))
    return replace(
        params_type(), **{name: _value(descriptions[name], value) for name, value in given.items()}
    )


def parse(pairs: list[str]) -> dict[str, str]:
    """`key=value` words of a command line."""
    given = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise InputError("option.form", pair=pair)
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
        raise InputError("option.not_one_of", name=d.name, value=text, values=", ".join(d.choices))
    if d.kind == "bool":
        if text.lower() not in ("true", "false", "yes", "no", "1", "0", "on", "off"):
            raise InputError("option.not_a_boolean", name=d.name, value=text)
        return text.lower() in ("true", "yes", "1", "on")
    if d.kind in ("float", "int"):
        try:
            number = float(text) if d.kind == "float" else int(text)
        except ValueError:
            if d.unit:
                raise InputError(
                    "option.not_a_number_in", name=d.name, value=text, unit=d.unit
                ) from None
            raise InputError("option.not_a_number", name=d.name, value=text) from None
        if not d.least <= number <= d.most:
            if d.unit:
                raise InputError(
                    "option.outside_in",
                    name=d.name,
                    value=text,
                    unit=d.unit,
                    least=d.least,
                    most=d.most,
                )
            raise InputError("option.outside", name=d.name, value=text, least=d.least, most=d.most)
        return number
    return text
