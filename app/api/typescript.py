"""TypeScript declarations of the API's values, from its OpenAPI description.

`make types` writes them to static/types/api.d.ts, where the pages' JavaScript names them in JSDoc.
"""

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handscope.app.server import create_app
from handscope.app.settings import Settings

HEAD = "/** Values of the HTTP API, written by `make types` from its OpenAPI description. */\n"
PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean"}


def declarations(description: Mapping[str, Any]) -> str:
    """One interface for each schema of an OpenAPI description, by name."""
    schemas = description["components"]["schemas"]
    named = (n for n in sorted(schemas) if "properties" in schemas[n] and not _is_foreign(n))
    return HEAD + "".join(f"\n{_interface(name, schemas[name])}" for name in named)


def _is_foreign(name: str) -> bool:
    """Whether the framework made the schema: of its refusals, and of forms."""
    return name.endswith("ValidationError") or name.startswith("Body_")


def _interface(name: str, schema: Mapping[str, Any]) -> str:
    required = schema.get("required", ())
    lines = [
        f"  {key}{'' if key in required else '?'}: {_type_of(value)};\n"
        for key, value in schema["properties"].items()
    ]
    about = schema.get("description", "").split("\n")[0]
    return f"/** {about} */\nexport interface {name} {{\n{''.join(lines)}}}\n"


def _type_of(schema: Mapping[str, Any]) -> str:
    """A schema as a TypeScript type; `any` where it says nothing."""
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "enum" in schema:
        return " | ".join(f'"{value}"' for value in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(dict.fromkeys(_type_of(one) for one in schema["anyOf"]))
    kind = schema.get("type")
    if kind == "array":
        inner = _type_of(schema.get("items", {}))
        return f"({inner})[]" if " | " in inner else f"{inner}[]"
    if kind == "object":
        more = schema.get("additionalProperties")
        return f"Record<string, {_type_of(more) if isinstance(more, Mapping) else 'any'}>"
    return "null" if kind == "null" else PLAIN.get(str(kind), "any")


def describe_api() -> dict[str, Any]:
    """The OpenAPI description of a server, none of which is started."""
    with tempfile.TemporaryDirectory() as folder:
        return dict(create_app(Settings(data=Path(folder))).openapi())


if __name__ == "__main__":
    sys.stdout.write(declarations(describe_api()))
