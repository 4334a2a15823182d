"""Words for what pydantic finds wrong with an input, by the kind of the mistake; another kind keeps pydantic's own words."""

from collections.abc import Mapping
from typing import Any

from handscope.estimators.messages.sentence import phrase

FIXED: Mapping[str, str] = {
    "missing": phrase("input.missing"),
    "extra_forbidden": phrase("input.unknown"),
    "int_parsing": phrase("input.integer_unreadable"),
    "int_type": phrase("input.integer"),
    "float_parsing": phrase("input.number_unreadable"),
    "float_type": phrase("input.number"),
    "string_type": phrase("input.text"),
    "bool_type": phrase("input.boolean"),
    "json_invalid": phrase("input.json"),
}


def describe_mistake(error: Mapping[str, Any]) -> str:
    """One of a ValidationError's `errors()` in words."""
    allowed = error.get("ctx") or {}
    match error["type"]:
        case "json_invalid" if error["msg"] != FIXED["json_invalid"]:
            return str(error["msg"])
        case "literal_error" | "enum":
            return phrase("input.not_one_of", values=allowed["expected"])
        case "greater_than":
            return phrase("input.greater", least=_limit(allowed["gt"]))
        case "greater_than_equal":
            return phrase("input.at_least", least=_limit(allowed["ge"]))
        case "less_than":
            return phrase("input.less", most=_limit(allowed["lt"]))
        case "less_than_equal":
            return phrase("input.at_most", most=_limit(allowed["le"]))
        case "string_too_short":
            return phrase("input.too_short", count=allowed["min_length"])
        case "string_too_long":
            return phrase("input.too_long", count=allowed["max_length"])
        case kind:
            return FIXED.get(kind, str(error["msg"]))


def _limit(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(value)
